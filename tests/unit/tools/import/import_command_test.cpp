#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <opencv2/videoio.hpp>

#include "capture/import/imu_csv.hpp"
#include "support/log_files.hpp"
#include "support/ros_bytes.hpp"
#include "unit/tools/import/import_command.hpp"

namespace fiducap {
namespace {

using test::RosDialect;
using test::StoredMessage;
using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

StoredMessage image(const std::string& topic, std::int64_t ns) {
  return {topic, "sensor_msgs/Image", kBegin_ns + ns,
          test::image_message(RosDialect::kRos1, ns == 0 ? 0 : kBegin_ns + ns, 64, 48,
                              std::string(64 * 48, 'x'))};
}
StoredMessage reading(std::int64_t ns, const std::string& topic = "/imu0",
                      const std::array<double, 3>& w = {0.01, 0, 0},
                      const std::array<double, 3>& f = {0, 0, 9.81}) {
  return {topic, "sensor_msgs/Imu", kBegin_ns + ns,
          test::imu_message(RosDialect::kRos1, kBegin_ns + ns, w, f)};
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

class ImportBagTest : public ImportCommandTest {
 protected:
  void run_bag(const std::vector<StoredMessage>& messages, int exit_code = kExitOk) {
    run(folder_.write("walk.bag", test::bag_file(messages)), exit_code);
  }
};

TEST_F(ImportBagTest, BagBecomesAUsableRecording) {
  arguments_.tag_size_m = 0.2;
  arguments_.tag_family = "AprilTag 16h5";
  run_bag(rest());
  const RecordingInfo info = recording();
  EXPECT_EQ(info.tag_family, "tag16h5");
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

TEST_F(ImportBagTest, WithoutAnOutputOnlyListsStreams) {
  arguments_.out.clear();
  run_bag(rest());
  EXPECT_THAT(out_, AllOf(HasSubstr("/imu0 (sensor_msgs/Imu): 100, 200.0 Hz"),
                          HasSubstr("/cam0/image_raw (sensor_msgs/Image, 64 x 48, mono8): 5"),
                          HasSubstr("with its lens")));
  arguments_.imu = {"nonexistent.csv"};
  run_bag(rest(), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("nonexistent.csv"));
}

TEST_F(ImportBagTest, RequestsAChoiceOfCameras) {
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

TEST_F(ImportBagTest, ErrorNamesMissingAndPresentStreams) {
  arguments_.imu = {"/imu/data"};
  run_bag(rest(), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("no IMU called /imu/data; there is: /imu0 (sensor_msgs/Imu)"));
  arguments_.imu.clear();
  run_bag({{"/scan", "sensor_msgs/LaserScan", kBegin_ns, ""}}, kExitFailed);
  EXPECT_THAT(err_, AllOf(HasSubstr("walk.bag: has no images"), HasSubstr("/scan")));
}

TEST_F(ImportBagTest, ZeroStampsNeedTheTimesOfTheRecorder) {
  const std::vector<StoredMessage> messages{image("/cam0/image_raw", 0)};
  run_bag(messages, kExitFailed);
  EXPECT_THAT(err_, HasSubstr("--stamps log"));
  arguments_.stamps = "log";
  run_bag(messages);
  EXPECT_EQ(images().size(), 1u);
}

TEST_F(ImportBagTest, JsonIsOneObject) {
  arguments_.json = true;
  run_bag(rest());
  const auto json = nlohmann::json::parse(out_);
  EXPECT_EQ(json["images_written"][0], 5);
  EXPECT_EQ(json["imu_written"], 100);
  EXPECT_EQ(json["streams"].size(), 2u);
  EXPECT_EQ(json["usable"], true);
  EXPECT_EQ(json["missing"].size(), 3u) << json["missing"];
}

TEST_F(ImportBagTest, VideoAndTableHaveTheTimeOfTheVideo) {
  const std::string video = folder_.file("walk.avi");
  {
    cv::VideoWriter writer(video, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10, {64, 48});
    for (int i = 0; i < 6; ++i) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(40 * i)));
  }
  std::string table = "t,gx,gy,gz,ax,ay,az\n";
  for (int i = 0; i < 100; ++i) table += std::to_string(5 * i) + ",0,0,90,0,0,1\n";
  arguments_.imu = {folder_.write("imu.csv", table)};
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

TEST_F(ImportBagTest, ImagesOfTenBitsAreBright) {
  std::vector<StoredMessage> messages;
  for (std::int64_t i = 1; i <= 4; ++i) {
    const std::int64_t ns = kBegin_ns + i * 100'000'000;
    messages.push_back(
        {"/ir/compressed", "sensor_msgs/CompressedImage", ns,
         test::compressed_message(RosDialect::kRos1, ns, picture(i == 1 ? 900 : 400, CV_16UC1))});
  }
  run_bag(messages);
  EXPECT_THAT(images().at(3).image->pixels, Each(100));
  EXPECT_THAT(out_, HasSubstr("its 16-bit images use 10 bits"));
}

TEST_F(ImportBagTest, JoinsGyroscopeAndAccelerometerOfTwoTopics) {
  std::vector<StoredMessage> messages{image("/camera/infra1/image_rect_raw", 50'000'000)};
  for (std::int64_t i = 1; i <= 100; ++i)
    messages.push_back(reading(i * kReading_ns, "/camera/gyro/sample", {0.1, 0, 0}, {0, 0, 0}));
  for (std::int64_t i = 0; i <= 50; ++i)
    messages.push_back(reading(i * 3 * kReading_ns - 1'000'000, "/camera/accel/sample", {0, 0, 0},
                               {0, 0, static_cast<double>(i)}));
  run_bag(messages);
  ASSERT_EQ(readings().size(), 100u);
  EXPECT_EQ(readings()[0].w_WB_B.x(), 0.1);
  EXPECT_NEAR(readings()[0].f_B.z(), 6.0 / 15, 1e-12);
  EXPECT_THAT(out_, HasSubstr("the accelerometer of /camera/accel/sample is interpolated"));
  // In another order, and named.
  std::ranges::stable_sort(messages, {}, &StoredMessage::topic);
  arguments_.imu = {"/camera/accel/sample", "/camera/gyro/sample"};
  arguments_.out = folder_.file("second");
  run_bag(messages);
  EXPECT_EQ(readings().size(), 100u);
  // No accelerometer for 0.4 s.
  std::erase_if(messages, [](const StoredMessage& m) {
    return m.topic == "/camera/accel/sample" && m.logged_ns > kBegin_ns + 50'000'000 &&
           m.logged_ns < kBegin_ns + 400'000'000;
  });
  arguments_.out = folder_.file("third");
  run_bag(messages);
  EXPECT_LT(readings().size(), 40u);
  arguments_.imu = {"/camera/gyro/sample", "/camera/gyro/sample"};
  run_bag(messages, kExitFailed);
  EXPECT_THAT(err_, HasSubstr("two IMUs are a gyroscope and an accelerometer"));
}

TEST_F(ImportBagTest, PartsOfARecordingAreOneRecording) {
  const std::vector<StoredMessage> all = rest();
  const auto part = [&](std::size_t from, std::size_t to) {
    return test::bag_file({all.begin() + static_cast<std::ptrdiff_t>(from),
                           all.begin() + static_cast<std::ptrdiff_t>(to)});
  };
  const std::vector<std::string> parts{folder_.write("split/run_10.bag", part(70, all.size())),
                                       folder_.write("split/run_2.bag", part(30, 70)),
                                       folder_.write("split/run_1.bag", part(0, 30))};
  run_all(parts);
  EXPECT_EQ(readings().size(), 100u);
  EXPECT_EQ(images().size(), 5u);
  EXPECT_THAT(out_, Not(HasSubstr("backwards")));
  arguments_.out = folder_.file("of_a_folder");
  run(folder_.file("split"));
  EXPECT_EQ(readings().size(), 100u);
  EXPECT_THAT(out_, HasSubstr("its 3 files are read as one recording"));
  arguments_.out = folder_.file("third");
  run_all({parts[0], folder_.write("walk.avi", "RIFF")}, kExitFailed);
  EXPECT_THAT(err_, HasSubstr("walk.avi: cannot be joined with others"));
}

TEST_F(ImportBagTest, ImuAloneIsRecordedForItsCalibration) {
  std::vector<StoredMessage> messages;
  std::string table = "time;gyro_x;gyro_y;gyro_z;acc_x;acc_y;acc_z\n";
  for (int i = 1; i <= 100; ++i) {
    messages.push_back(reading(i * kReading_ns));
    table += std::to_string(kBegin_ns + i * kReading_ns) + ";0,01;0;0;0;0;9,81\n";
  }
  for (const std::string& source :
       {folder_.write("still.bag", test::bag_file(messages)), folder_.write("still.csv", table)}) {
    arguments_.out = source + "_recording";
    run(source);
    EXPECT_THAT(out_, AllOf(HasSubstr("no images, 100 IMU readings"),
                            HasSubstr("next: fiducap calibrate imu"), Not(HasSubstr("missing"))));
    const auto csv = value_of(read_imu_csv(arguments_.out + "/mav0/imu0/data.csv", {}));
    ASSERT_EQ(csv.samples.size(), 100u);
    EXPECT_EQ(to_ns(csv.samples[0].sampled_at), kBegin_ns + kReading_ns);
    EXPECT_EQ(csv.samples[0].w_WB_B.x(), 0.01);
  }
  arguments_.imu = {"none"};
  arguments_.out = folder_.file("nothing");
  run_bag(messages, kExitFailed);
  EXPECT_THAT(err_, HasSubstr("neither images nor an IMU"));
}

TEST_F(ImportBagTest, ErrorListsTheFormats) {
  run(folder_.write("a.txt", "hello"), kExitFailed);
  EXPECT_THAT(err_, AllOf(HasSubstr("expected a bag of ROS 1, rosbag2"),
                          HasSubstr("as a table: no column for time")));
  run(folder_.file("nothing"), kExitFailed);
  run(folder_.write("other.zip", test::zip_file({{"a", "b"}})), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("not one of Sensor Logger"));
}

TEST_F(ImportBagTest, OverwritesNoFolderWithContent) {
  folder_.write("recording/precious", "data");
  run_bag(rest(), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("is not empty"));
}

TEST_F(ImportBagTest, FailureLeavesTheFolderFree) {
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
