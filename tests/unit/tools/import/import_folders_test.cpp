#include <gmock/gmock.h>

#include "support/log_files.hpp"
#include "unit/tools/import/import_command.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

TEST_F(ImportCommandTest, ReadsAslFoldersOf16BitsWithoutCalibration) {
  for (int i = 1; i <= 5; ++i)
    folder_.write("room/mav0/cam0/data/" + std::to_string(kBegin_ns + i * 50'000'000) + ".png",
                  picture(256 * 200 + 7, CV_16UC1));
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
  EXPECT_THAT(images()[0].image->pixels, Each(200));
  EXPECT_THAT(out_, HasSubstr("stamped by their names"));
}

/// Folders of EuRoC and their relatives.
class AslTest : public ImportCommandTest {
 protected:
  void write_images(const std::string& folder) const {
    for (int i = 1; i <= 5; ++i)
      folder_.write(folder + "/" + std::to_string(kBegin_ns + i * 50'000'000) + ".png",
                    picture(100));
  }
  static std::string imu_table() {
    std::string table = "#timestamp [ns],wx,wy,wz,ax,ay,az\n";
    for (int i = 0; i < 60; ++i)
      table += std::to_string(kBegin_ns + i * kReading_ns) + ",0.5,0,0,0,0,9.81\n";
    return table;
  }
  static std::string truth_table() {
    std::string table = "#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z\n";
    for (int i = 0; i < 30; ++i)
      table += std::to_string(kBegin_ns + i * 10'000'000) + ",1,2,3,1,0,0,0\n";
    return table;
  }
  static constexpr const char* kIdentity =
      "T_BS:\n  cols: 4\n  rows: 4\n  data: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n";
  static constexpr const char* kLens =
      "camera_model: pinhole\nresolution: [64, 48]\nintrinsics: [50, 50, 31.5, 23.5]\n"
      "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n";
};

TEST_F(AslTest, OneMissingFileCostsOnlyItself) {
  write_images("walk/mav0/cam0/data");
  folder_.write("walk/mav0/imu0/data.csv", imu_table());
  folder_.write("walk/mav0/cam0/sensor.yaml", std::string(kIdentity) + kLens);
  run(folder_.file("walk"));
  EXPECT_EQ(recording().cameras[0].model.fu, 50);
  EXPECT_THAT(out_, AllOf(HasSubstr("imu0/sensor.yaml: no such file"),
                          HasSubstr("missing: noise of the IMU"), Not(HasSubstr("missing: lens")),
                          Not(HasSubstr("missing: place"))));
  // The lens without a place, a file of tags that is none, noise beside them.
  folder_.write("walk/mav0/cam0/sensor.yaml", kLens);
  folder_.write("walk/mav0/tags.yaml", "default_size_m: -1\n");
  folder_.write("walk/dso/imu_config.yaml",
                "accelerometer_noise_density: 0.01\naccelerometer_random_walk: 0.001\n"
                "gyroscope_noise_density: 0.002\ngyroscope_random_walk: 0.0001\n"
                "update_rate: 200\n");
  arguments_.out = folder_.file("second");
  run(folder_.file("walk"));
  EXPECT_EQ(recording().cameras[0].model.fu, 50);
  EXPECT_EQ(recording().imu->gyro_noise_rad_s_rtHz, 0.002);
  EXPECT_THAT(out_, AllOf(HasSubstr("missing: place"), HasSubstr("default_size_m"),
                          Not(HasSubstr("missing: noise")), Not(HasSubstr("missing: lens"))));
}

TEST_F(AslTest, FolderOfKalibrHasCamerasAndImuInItself) {
  write_images("dataset/cam0");
  write_images("dataset/cam1");
  folder_.write("dataset/imu0.csv", imu_table());
  run(folder_.file("dataset"));
  EXPECT_EQ(recording().cameras.size(), 2u);
  EXPECT_EQ(readings().size(), 60u);
  EXPECT_EQ(to_ns(images()[0].exposed_at), kBegin_ns + 50'000'000);
}

TEST_F(AslTest, ListsHaveStampsInAnyUnitAndNamesWithoutEnding) {
  write_images("walk/mav0/cam0/data");
  const auto name = [](int i) { return std::to_string(kBegin_ns + i * 50'000'000); };
  const auto cut = [&](int i, std::size_t digits) { return name(i).substr(0, digits); };
  std::string seconds = "#timestamp [s],filename\n", microseconds, names = "stamp\n", others;
  for (int i = 1; i <= 5; ++i) {
    seconds += cut(i, 10) + "." + name(i).substr(10) + "," + name(i) + ".png\n";
    microseconds += cut(i, 16) + "," + name(i) + "\n";
    names += name(i) + "\n";
    others += name(i) + "," + name(i) + ".jpg\n";
  }
  for (const std::string& list : {seconds, microseconds, names, others}) {
    folder_.write("walk/mav0/cam0/data.csv", list);
    arguments_.out += "_";
    run(folder_.file("walk"));
    ASSERT_EQ(images().size(), 5u) << list;
    EXPECT_EQ(to_ns(images()[4].exposed_at), kBegin_ns + 250'000'000) << list;
    EXPECT_THAT(out_, Not(HasSubstr("unreadable"))) << list;
  }
}

TEST_F(AslTest, FolderWithAVideoNamesTheCommandForIt) {
  folder_.write("phone/movie.mp4", "x");
  folder_.write("phone/gyro_accel.csv", "x");
  run(folder_.file("phone"), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("Its video: fiducap import " + folder_.file("phone/movie.mp4") +
                              " --imu " + folder_.file("phone/gyro_accel.csv")));
}

TEST_F(AslTest, PicturesWithoutTimesAreRefused) {
  for (int i = 1; i <= 3; ++i)
    folder_.write("walk/mav0/cam0/data/image" + std::to_string(i) + ".png", picture(100));
  folder_.write("walk/mav0/imu0/data.csv", imu_table());
  run(folder_.file("walk"), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("has pictures, but no times of them"));
  folder_.write("walk/mav0/cam0/data.csv", "0,image1.png\n100,image2.png\n200,image3.png\n");
  run(folder_.file("walk"), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("cam0: its 3 images are numbered"));
}

TEST_F(AslTest, MotionCaptureIsTruthAndOtherSensorsAreNamed) {
  write_images("room/mav0/cam0/data");
  folder_.write("room/mav0/mocap0/data.csv", truth_table());
  folder_.write("room/mav0/leica0/data.csv", "#timestamp,x,y,z\n");
  folder_.write("room/groundtruth.txt", "1 0 0 0 0 0 0 1\n");
  run(folder_.file("room"));
  EXPECT_THAT(out_, HasSubstr("leica0 (positions without attitudes): not used"));
  EXPECT_THAT(out_, HasSubstr("groundtruth.txt (truth is read from mav0/mocap0/data.csv"));
  auto truth = value_of(read_truth(arguments_.out));
  ASSERT_EQ(truth.size(), 30u);
  EXPECT_EQ(truth[0].X_WB.p, Eigen::Vector3d(1, 2, 3));
  // The marker sits 0.5 m beside the body's origin.
  std::filesystem::rename(folder_.path() / "room/mav0/mocap0", folder_.path() / "room/mav0/vicon0");
  folder_.write("room/mav0/vicon0/sensor.yaml",
                "T_BS:\n  cols: 4\n  rows: 4\n"
                "  data: [1,0,0,0.5, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n");
  arguments_.out = folder_.file("second");
  run(folder_.file("room"));
  EXPECT_EQ(value_of(read_truth(arguments_.out)).at(0).X_WB.p, Eigen::Vector3d(0.5, 2, 3));
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

}  // namespace
}  // namespace fiducap
