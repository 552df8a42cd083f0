#include <filesystem>
#include <functional>
#include <random>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording_writer.hpp"
#include "support/temporary_folder.hpp"
#include "tools/calibrate/calibrate.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

constexpr ImuNoise kTrue{2e-3, 2e-5, 2e-2, 5e-4, 200.0};

class CalibrateImu : public ::testing::Test {
 protected:
  /// An IMU on a table; `disturb` may move it.
  void record(double seconds, const std::function<void(double t_s, ImuSample&)>& disturb = {}) {
    RecordingInfo info;
    info.folder = recording_;
    info.imu = kTrue;
    info.cameras = {CameraMount{{640, 480, 400, 400, 320, 240, Distortion::kNone, {}}, Pose{}}};
    info.has_images = {false};
    info.has_corners = {false};
    auto writer = RecordingWriter::create(info);
    ASSERT_TRUE(writer) << writer.error().text();
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    const auto three = [&] {
      return Eigen::Vector3d(normal(random), normal(random), normal(random));
    };
    const double root_rate = std::sqrt(kTrue.rate_hz);
    const int samples = static_cast<int>(seconds * kTrue.rate_hz);
    for (int i = 0; i <= samples; ++i) {
      ImuSample imu{
          instant_from_ns(1'000'000'000LL + 5'000'000LL * i),
          Eigen::Vector3d(0.01, -0.02, 0.03) + kTrue.gyro_noise_rad_s_rtHz * root_rate * three(),
          Eigen::Vector3d(0.1, 0.2, 9.81) + kTrue.accel_noise_m_s2_rtHz * root_rate * three()};
      if (disturb) disturb(i / kTrue.rate_hz, imu);
      ASSERT_TRUE(writer->write(imu));
    }
    ASSERT_TRUE(writer->finish());
  }

  int calibrate(bool json = false) {
    return run_calibrate_imu({recording_, folder_.file("out"), json}, {out_, err_});
  }

  TemporaryFolder folder_;
  std::string recording_{folder_.file("still")};
  std::ostringstream out_;
  std::ostringstream err_;
};

TEST_F(CalibrateImu, KeepsWhatWasThereBefore) {
  folder_.write("out/imu.yaml", "of another IMU\n");
  record(70);
  EXPECT_EQ(calibrate(), 0) << err_.str();
  EXPECT_EQ(read_whole_file(folder_.file("out/imu.yaml.before")), "of another IMU\n");
  EXPECT_THAT(err_.str(), HasSubstr("is kept as"));
}

TEST_F(CalibrateImu, WritesAFileThatTheConfigurationReads) {
  record(100);
  ASSERT_EQ(calibrate(), kExitOk) << err_.str();
  const auto noise = read_kalibr_imu(folder_.file("out/imu.yaml"));
  ASSERT_TRUE(noise) << noise.error().text();
  // 3 axes of 20 000 samples: √(3/4n) is 0.35 %, four sigma.
  EXPECT_NEAR(noise->gyro_noise_rad_s_rtHz / kTrue.gyro_noise_rad_s_rtHz, 1, 0.014);
  EXPECT_NEAR(noise->accel_noise_m_s2_rtHz / kTrue.accel_noise_m_s2_rtHz, 1, 0.014);
  EXPECT_NEAR(noise->rate_hz, 200, 1e-6);
  EXPECT_THAT(out_.str(), HasSubstr("gyro: no bias walk to be seen"));
  EXPECT_THAT(*read_whole_file(folder_.file("out/imu.yaml")), HasSubstr("upper bound"));
  EXPECT_THAT(*read_whole_file(folder_.file("out/allan.html")), HasSubstr("Allan deviation"));
}

TEST_F(CalibrateImu, GivesNumbersForScripts) {
  record(100);
  ASSERT_EQ(calibrate(true), kExitOk) << err_.str();
  const auto report = nlohmann::json::parse(out_.str());
  EXPECT_EQ(report["axes"].size(), kImuAxes);
  EXPECT_TRUE(report["gyroscope_random_walk_is_bound"].get<bool>());
  EXPECT_EQ(report["lost"].get<int>(), 0);
}

TEST_F(CalibrateImu, NeedsNoCamera) {
  record(70);
  std::filesystem::remove_all(recording_ + "/mav0/cam0");
  EXPECT_EQ(calibrate(), kExitOk) << err_.str();
}

TEST_F(CalibrateImu, RefusesAnImuThatMovedAndSaysWhen) {
  record(100, [](double t_s, ImuSample& imu) {
    if (t_s > 42.1 && t_s < 43.9) imu.w_WB_B.y() += 0.1;
  });
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("did not lie still: gyro y moved 42 s"));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("out/imu.yaml")));
}

TEST_F(CalibrateImu, RefusesAKnockOnTheTable) {
  record(100, [](double t_s, ImuSample& imu) {
    if (t_s > 42.1 && t_s < 42.4) imu.f_B.z() += 8 * std::sin(300 * t_s);
  });
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("accelerometer z moved 42 s"));
}

TEST_F(CalibrateImu, RefusesHalfAMinute) {
  record(30);
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("at least 60 s"));
}

}  // namespace
}  // namespace fiducap
