#include "tools/import/import.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "support/command_run.hpp"
#include "support/log_files.hpp"
#include "support/ros_bytes.hpp"
#include "unit/tools/import/recorded_samples.hpp"

namespace fiducap {
namespace {

using test::RosDialect;
using test::StoredMessage;
using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

constexpr std::int64_t kBegin_ns = 1'600'000'000'000'000'000;
constexpr std::int64_t kReading_ns = 5'000'000;

std::string picture(int brightness, int type = CV_8UC1) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", cv::Mat(48, 64, type, cv::Scalar(brightness)), bytes);
  return {bytes.begin(), bytes.end()};
}

StoredMessage image(const std::string& topic, std::int64_t ns) {
  return {topic, "sensor_msgs/Image", kBegin_ns + ns,
          test::image_message(RosDialect::kRos1, ns == 0 ? 0 : kBegin_ns + ns, 64, 48,
                              std::string(64 * 48, 'x'))};
}
StoredMessage reading(std::int64_t ns) {
  return {"/imu0", "sensor_msgs/Imu", kBegin_ns + ns,
          test::imu_message(RosDialect::kRos1, kBegin_ns + ns, {0.01, 0, 0}, {0, 0, 9.81})};
}

/// Half a second at rest: 100 readings, 5 images of `/cam0/image_raw`.
std::vector<StoredMessage> rest() {
  std::vector<StoredMessage> messages;
  for (std::int64_t i = 1; i <= 100; ++i) {
    messages.push_back(reading(i * kReading_ns));
    if (i % 20 == 0) messages.push_back(image("/cam0/image_raw", i * kReading_ns));
  }
  messages.push_back({"/cam0/camera_info", "sensor_msgs/CameraInfo", kBegin_ns,
                      test::camera_info_message(RosDialect::kRos1, kBegin_ns, 64, 48, 50)});
  return messages;
}

class ImportCommandTest : public VerbTest<ImportArguments> {
 protected:
  ImportCommandTest() { arguments_.out = folder_.file("recording"); }

  void run(const std::string& source, int exit_code = kExitOk) {
    arguments_.source = source;
    VerbTest::run(run_import, exit_code);
  }
  void run_bag(const std::vector<StoredMessage>& messages, int exit_code = kExitOk) {
    run(folder_.write("walk.bag", test::bag_file(messages)), exit_code);
  }
  [[nodiscard]] RecordingInfo recording() const {
    return value_of(read_recording_info(arguments_.out));
  }
  [[nodiscard]] std::vector<ImuSample> readings() const {
    return recorded<ImuSample>(arguments_.out);
  }
  [[nodiscard]] std::vector<CameraFrame> images() const {
    return recorded<CameraFrame>(arguments_.out);
  }
};

TEST_F(ImportCommandTest, BagBecomesAUsableRecording) {
  arguments_.tag_size_m = 0.2;
  run_bag(rest());
  const RecordingInfo info = recording();
  ASSERT_EQ(info.cameras.size(), 1u);
  EXPECT_EQ(info.cameras[0].model.fu, 50);
  EXPECT_NEAR(info.cameras[0].rate_hz, 10, 1e-9);
  EXPECT_EQ(info.tag_size_m, 0.2);
  ASSERT_TRUE(info.imu);
  EXPECT_NEAR(info.imu->rate_hz, 200, 1e-9);
  ASSERT_EQ(readings().size(), 100u);
  EXPECT_EQ(to_ns(readings()[0].sampled_at), kBegin_ns + kReading_ns);
  EXPECT_EQ(readings()[0].w_WB_B.x(), 0.01);
  ASSERT_EQ(images().size(), 5u);
  EXPECT_THAT(images()[0].image->pixels, Each('x'));
  EXPECT_THAT(out_, AllOf(HasSubstr("5 images of /cam0/image_raw, 100 IMU readings"),
                          HasSubstr("missing: place of /cam0/image_raw on the IMU"),
                          HasSubstr("missing: noise of the IMU"), Not(HasSubstr("missing: lens")),
                          Not(HasSubstr("size of the tags")), HasSubstr("next: fiducap replay")));
}

TEST_F(ImportCommandTest, WithoutAnOutputOnlyListsStreams) {
  arguments_.out.clear();
  run_bag(rest());
  EXPECT_THAT(out_, AllOf(HasSubstr("/imu0 (sensor_msgs/Imu): 100, 200.0 Hz"),
                          HasSubstr("/cam0/image_raw (sensor_msgs/Image, 64 x 48, mono8): 5"),
                          HasSubstr("with its lens")));
  arguments_.imu = "nonexistent.csv";
  run_bag(rest(), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("nonexistent.csv"));
}

TEST_F(ImportCommandTest, RequestsAChoiceOfCameras) {
  auto messages = rest();
  messages.push_back({"/cam1/image_raw/compressed", "sensor_msgs/CompressedImage", kBegin_ns + 1,
                      test::compressed_message(RosDialect::kRos1, kBegin_ns + 1, picture(77))});
  run_bag(messages, kExitFailed);
  EXPECT_THAT(err_, AllOf(HasSubstr("images of 2 cameras"), HasSubstr("--image /cam0/image_raw"),
                          HasSubstr("--image /cam1/image_raw/compressed")));
  arguments_.images = {"/cam1/image_raw/compressed", "/cam0/image_raw"};
  run_bag(messages);
  EXPECT_THAT(out_, HasSubstr("1 images of /cam1/image_raw/compressed, 5 images of /cam0/image"));
  EXPECT_THAT(images()[0].image->pixels, Each(77));
}

TEST_F(ImportCommandTest, ErrorNamesMissingAndPresentStreams) {
  arguments_.imu = "/imu/data";
  run_bag(rest(), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("no IMU called /imu/data; there is: /imu0 (sensor_msgs/Imu)"));
  arguments_.imu.clear();
  run_bag({reading(0)}, kExitFailed);
  EXPECT_THAT(err_, AllOf(HasSubstr("walk.bag: has no images"), HasSubstr("/imu0")));
}

TEST_F(ImportCommandTest, ZeroStampsNeedTheTimesOfTheRecorder) {
  const std::vector<StoredMessage> messages{image("/cam0/image_raw", 0)};
  run_bag(messages, kExitFailed);
  EXPECT_THAT(err_, HasSubstr("--stamps log"));
  arguments_.stamps = "log";
  run_bag(messages);
  EXPECT_EQ(images().size(), 1u);
}

TEST_F(ImportCommandTest, JsonIsOneObject) {
  arguments_.json = true;
  run_bag(rest());
  const auto json = nlohmann::json::parse(out_);
  EXPECT_EQ(json["images_written"][0], 5);
  EXPECT_EQ(json["imu_written"], 100);
  EXPECT_EQ(json["streams"].size(), 2u);
  EXPECT_EQ(json["usable"], true);
  EXPECT_EQ(json["missing"].size(), 3u) << json["missing"];
}

TEST_F(ImportCommandTest, VideoAndTableHaveTheTimeOfTheVideo) {
  const std::string video = folder_.file("walk.avi");
  {
    cv::VideoWriter writer(video, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10, {64, 48});
    for (int i = 0; i < 6; ++i) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(40 * i)));
  }
  std::string table = "t,gx,gy,gz,ax,ay,az\n";
  for (int i = 0; i < 100; ++i) table += std::to_string(5 * i) + ",0,0,90,0,0,1\n";
  arguments_.imu = folder_.write("imu.csv", table);
  arguments_.imu_offset_s = 0.02;
  run(video);
  ASSERT_EQ(readings().size(), 100u);
  const auto frames = images();
  ASSERT_EQ(frames.size(), 6u);
  EXPECT_EQ(readings()[0].sampled_at - frames[0].exposed_at, std::chrono::milliseconds(20));
  EXPECT_EQ(frames[5].exposed_at - frames[0].exposed_at, std::chrono::milliseconds(500));
  EXPECT_NEAR(readings()[0].f_B.z(), 9.80665, 1e-9);
  EXPECT_THAT(out_, AllOf(HasSubstr("time is assumed in ms"), HasSubstr("assumed in deg/s"),
                          HasSubstr("missing: lens of walk.avi")));
}

TEST_F(ImportCommandTest, ReadsAslFoldersOf16BitsWithoutCalibration) {
  for (int i = 1; i <= 5; ++i)
    folder_.write("room/mav0/cam0/data/" + std::to_string(kBegin_ns + i * 50'000'000) + ".png",
                  picture(256 * 100 + 7, CV_16UC1));
  std::string table =
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
      "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
  for (int i = 0; i < 60; ++i)
    table += std::to_string(kBegin_ns + i * kReading_ns) + ",0.5,0,0,0,0,9.81\n";
  folder_.write("room/mav0/imu0/data.csv", table);
  run(folder_.file("room"));
  EXPECT_EQ(readings().size(), 60u);
  ASSERT_EQ(images().size(), 5u);
  EXPECT_EQ(to_ns(images()[0].exposed_at), kBegin_ns + 50'000'000);
  EXPECT_THAT(images()[0].image->pixels, Each(100));
  EXPECT_THAT(out_, HasSubstr("stamped by their names"));
}

class PhoneTest : public ImportCommandTest {
 protected:
  static std::string table(const std::string& values, std::int64_t from_ms, std::int64_t to_ms) {
    std::string text = "time,seconds_elapsed,z,y,x\n";
    for (std::int64_t ms = from_ms; ms <= to_ms; ms += 10)
      text += std::to_string(kBegin_ns + ms * 1'000'000) + ",0.1," + values + "\n";
    return text;
  }
  std::vector<test::StoredFile> files_{
      {"Gyroscope.csv", table("3,2,1", 5, 495)},
      {"Accelerometer.csv", table("0.3,0.2,0.1", 0, 500)},
      {"Gravity.csv", table("-9.8,0,0", 0, 500)},
      {"Camera/1600000000100.png", picture(50), false},
      {"Camera/1600000000200.png", picture(60), false},
      {"TotalAcceleration.csv", ""},  // as the app writes it on iOS
      {"Metadata.csv", "version,device name,platform,standardisation\n3,Phone,ios,false\n"}};
};

TEST_F(PhoneTest, AccelerationAndGravityGiveSpecificForce) {
  run(folder_.write("phone.zip", test::zip_file(files_)));
  ASSERT_EQ(readings().size(), 50u);
  EXPECT_EQ(to_ns(readings()[0].sampled_at), kBegin_ns + 5'000'000);
  EXPECT_TRUE(readings()[0].w_WB_B.isApprox(Eigen::Vector3d(1, 2, 3)));
  EXPECT_TRUE(readings()[0].f_B.isApprox(Eigen::Vector3d(-0.1, -0.2, 9.5), 1e-12));
  ASSERT_EQ(images().size(), 2u);
  EXPECT_EQ(to_ns(images()[0].exposed_at), kBegin_ns + 100'000'000);
  EXPECT_THAT(out_, AllOf(HasSubstr("Accelerometer.csv + Gravity.csv"),
                          HasSubstr("the sign of specific force is inverted"),
                          Not(HasSubstr("missing: place"))));
  // Image x points down the phone, z out of its back.
  const Eigen::Matrix3d R_BV = recording().cameras[0].X_BV.rotation();
  EXPECT_TRUE(R_BV.col(0).isApprox(-Eigen::Vector3d::UnitY()));
  EXPECT_TRUE(R_BV.col(2).isApprox(-Eigen::Vector3d::UnitZ()));
  arguments_.out = folder_.file("second");
  files_.erase(files_.begin() + 2);
  run(folder_.write("phone.zip", test::zip_file(files_)), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("together with Gravity.csv is needed"));
}

TEST_F(PhoneTest, TotalAccelerationNeedsNoGravity) {
  for (const auto& file : files_)
    if (file.name != "Metadata.csv" && file.name != "Gravity.csv")
      folder_.write("phone/" + file.name, file.content);
  folder_.write("phone/TotalAcceleration.csv", table("9.8,0.2,0.1", 0, 500));
  folder_.write("phone/Metadata.csv", "platform\nandroid\n");
  run(folder_.file("phone"));
  EXPECT_TRUE(readings()[0].f_B.isApprox(Eigen::Vector3d(0.1, 0.2, 9.8)));
}

TEST_F(ImportCommandTest, ErrorListsTheFormats) {
  run(folder_.write("a.txt", "hello"), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("expected a bag of ROS 1, rosbag2"));
  run(folder_.file("nothing"), kExitFailed);
  run(folder_.write("other.zip", test::zip_file({{"a", "b"}})), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("not one of Sensor Logger"));
}

TEST_F(ImportCommandTest, OverwritesNoFolderWithContent) {
  folder_.write("recording/precious", "data");
  run_bag(rest(), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("is not empty"));
}

TEST_F(ImportCommandTest, FailureLeavesTheFolderFree) {
  arguments_.imu_offset_s = -1e10;  // before 1970
  run_bag(rest(), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("what was written is removed"));
  arguments_.imu_offset_s = 0;
  arguments_.tag_family = "tag36h12";
  run_bag(rest(), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("--tag-family"));
  arguments_.tag_family = "";
  run_bag(rest());
  EXPECT_EQ(recording().cameras.size(), 1u);
}

}  // namespace
}  // namespace fiducap
