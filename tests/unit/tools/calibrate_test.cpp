#include <gmock/gmock.h>

#include <filesystem>
#include <functional>
#include <random>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "calibration/extrinsics/camera_imu_calibration.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording_writer.hpp"
#include "simulation/simulation.hpp"
#include "support/command_run.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "tools/calibrate/calibrate.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

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
    auto writer = value_of(RecordingWriter::create(info));
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    const auto three = [&](double density) -> Eigen::Vector3d {
      const double x = normal(random), y = normal(random), z = normal(random);
      return density * std::sqrt(kTrue.rate_hz) * Eigen::Vector3d(x, y, z);
    };
    for (int i = 0; i <= static_cast<int>(seconds * kTrue.rate_hz); ++i) {
      ImuSample imu{instant_from_ns(1'000'000'000LL + 5'000'000LL * i),
                    Eigen::Vector3d(0.01, -0.02, 0.03) + three(kTrue.gyro_noise_rad_s_rtHz),
                    Eigen::Vector3d(0.1, 0.2, 9.81) + three(kTrue.accel_noise_m_s2_rtHz)};
      if (disturb) disturb(i / kTrue.rate_hz, imu);
      ASSERT_TRUE(writer.write(imu));
    }
    ASSERT_TRUE(writer.finish());
  }
  CommandRun calibrate(bool json = false) const {
    return on_terminal([&](const Terminal& terminal) {
      return run_calibrate_imu({recording_, folder_.file("out"), json}, terminal);
    });
  }
  void expect_refused(const char* reason) const {
    const auto run = calibrate();
    EXPECT_EQ(run.code, kExitFailed);
    EXPECT_THAT(run.err, HasSubstr(reason));
    EXPECT_FALSE(std::filesystem::exists(folder_.file("out/imu.yaml")));
  }

  TemporaryFolder folder_;
  std::string recording_{folder_.file("still")};
};

TEST_F(CalibrateImu, KeepsAnEarlierCalibration) {
  folder_.write("out/imu.yaml", "of another IMU\n");
  record(70);
  const auto run = calibrate();
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(read_whole_file(folder_.file("out/imu.yaml.before")), "of another IMU\n");
  EXPECT_THAT(run.err, HasSubstr("is kept as"));
}

TEST_F(CalibrateImu, WritesConfigurationPageAndJson) {
  record(100);
  std::filesystem::remove_all(recording_ + "/mav0/cam0");  // no camera is needed
  auto run = calibrate();
  ASSERT_EQ(run.code, kExitOk) << run.err;
  const auto noise = value_of(read_kalibr_imu(folder_.file("out/imu.yaml")));
  // 3 axes of 20 000 samples: √(3/4n) is 0.35 %, four sigma.
  EXPECT_NEAR(noise.gyro_noise_rad_s_rtHz / kTrue.gyro_noise_rad_s_rtHz, 1, 0.014);
  EXPECT_NEAR(noise.accel_noise_m_s2_rtHz / kTrue.accel_noise_m_s2_rtHz, 1, 0.014);
  EXPECT_NEAR(noise.rate_hz, 200, 1e-6);
  EXPECT_THAT(run.out, HasSubstr("gyro: no bias walk to be seen"));
  EXPECT_THAT(value_of(read_whole_file(folder_.file("out/imu.yaml"))), HasSubstr("upper bound"));
  EXPECT_THAT(value_of(read_whole_file(folder_.file("out/allan.html"))),
              HasSubstr("Allan deviation"));
  run = calibrate(true);
  ASSERT_EQ(run.code, kExitOk) << run.err;
  const auto report = nlohmann::json::parse(run.out);
  EXPECT_EQ(report["axes"].size(), kImuAxes);
  EXPECT_TRUE(report["gyroscope_random_walk_is_bound"].get<bool>());
  EXPECT_EQ(report["lost"].get<int>(), 0);
}

TEST_F(CalibrateImu, RefusesARotation) {
  record(100, [](double t_s, ImuSample& imu) {
    if (t_s > 42.1 && t_s < 43.9) imu.w_WB_B.y() += 0.1;
  });
  expect_refused("did not lie still: gyro y moved 42 s");
}

TEST_F(CalibrateImu, RefusesAnImpactOnTheTable) {
  record(100, [](double t_s, ImuSample& imu) {
    if (t_s > 42.1 && t_s < 42.4) imu.f_B.z() += 8 * std::sin(300 * t_s);
  });
  expect_refused("accelerometer z moved 42 s");
}

TEST_F(CalibrateImu, RefusesHalfAMinute) {
  record(30);
  expect_refused("at least 60 s");
}

constexpr double kStampError_s = 0.012;  // stamps are too late: the shift is negative
constexpr double kTime_s = 0.001;
constexpr double kSigmas = 3.5;  // six numbers: 3 sigma of one is 3.5 of the worst

class CalibrateExtrinsics : public ::testing::Test {
 protected:
  void record(double seconds, bool with_imu = true) {
    simulation::RoomConfig room;
    room.preset = "table";
    simulation::SimulatedBodyConfig body;
    CameraMount camera;
    camera.model = {
        752, 480, 460, 460, 376, 240, Distortion::kRadialTangential, {-0.28, 0.07, 2e-4, -1e-4, 0}};
    camera.X_BV = simulation::forward_camera();
    camera.X_BV.p = {0.06, -0.015, 0.02};
    body.cameras = {camera};
    body.camera.images = false;
    body.trajectory.kind = "table";
    body.trajectory.duration_s = seconds;
    body.faults.image_stamp_error_s = kStampError_s;
    truth_ = camera.X_BV;
    const auto source = value_of(
        simulation::make_simulated_source(room, body, instant_from_ns(1'000'000'000), nullptr));
    camera.X_BV.p += Eigen::Vector3d(0.012, -0.008, 0.01);
    camera.X_BV.q = (camera.X_BV.q * exp_so3({0.02, -0.015, 0.01})).normalized();
    RecordingInfo info;
    info.folder = recording_;
    info.cameras = {camera};
    info.has_images = {false};
    info.has_corners = {true};
    if (with_imu) info.imu = body.imu.noise;
    const auto tags = simulation::tags_of(room);
    info.tag_size_m = tags.front().edge_m;
    info.reference_tag = tags.front().tag_id;
    auto writer = value_of(RecordingWriter::create(info));
    for (auto sample = value_of(source->next({})); sample; sample = value_of(source->next({})))
      if (with_imu || !std::holds_alternative<ImuSample>(*sample))
        ASSERT_TRUE(writer.write(*sample));
    ASSERT_TRUE(writer.finish());
  }

  CommandRun calibrate() const {
    CalibrateExtrinsicsArguments arguments;
    arguments.recording = recording_;
    arguments.out = folder_.file("out");
    arguments.json = true;
    return on_terminal(
        [&](const Terminal& terminal) { return run_calibrate_extrinsics(arguments, terminal); });
  }

  TemporaryFolder folder_;
  std::string recording_{folder_.file("waving")};
  Pose truth_;
};

TEST_F(CalibrateExtrinsics, FindsPoseAndTimeShiftWithinTheSigmas) {
  record(40);
  const auto run = calibrate();
  ASSERT_EQ(run.code, kExitOk) << run.err;
  const auto camera = nlohmann::json::parse(run.out)["cameras"][0];
  const auto chain = value_of(read_kalibr_camchain(folder_.file("out/camchain-imucam.yaml")));
  ASSERT_EQ(chain.size(), 1U);
  const Pose& found = chain.front().X_BV;
  Eigen::Matrix<double, 6, 1> off;
  off << found.p - truth_.p, log_so3(found.q * truth_.q.conjugate());
  for (int i = 0; i < 6; ++i) {
    const double sigma = camera["sigma_m_rad"][static_cast<std::size_t>(i)].get<double>();
    EXPECT_LT(std::abs(off(i)), kSigmas * sigma) << "axis " << i;
    EXPECT_LT(sigma, i < 3 ? 0.003 : 0.001) << "axis " << i;
  }
  EXPECT_NEAR(to_seconds(chain.front().time_shift), -kStampError_s, kTime_s);
  EXPECT_NEAR(chain.front().model.coefficients[0], -0.28, 1e-9);
}

TEST_F(CalibrateExtrinsics, ReportsWhatTooLittleMotionDoesNotDetermine) {
  record(1);  // the simulator rests for its first second
  const auto run = calibrate();
  ASSERT_EQ(run.code, kExitOk) << run.err;
  const auto report = nlohmann::json::parse(run.out);
  EXPECT_EQ(report["verdict"], "weak");
  ASSERT_GE(report["cameras"][0]["not_observed"].size(), 3U);
  EXPECT_THAT(report["cameras"][0]["not_observed"][0]["motion"].get<std::string>(),
              HasSubstr("rotate quickly"));
}

TEST_F(CalibrateExtrinsics, NeedsAnImu) {
  record(3, false);
  const auto run = calibrate();
  EXPECT_EQ(run.code, kExitFailed);
  EXPECT_THAT(run.err, HasSubstr("no IMU"));
}

TEST(KalibrCamchain, RoundTripKeepsEveryValue) {
  CameraMount mount;
  mount.model = {
      640, 400, 300, 301, 320, 200, Distortion::kEquidistant, {0.1, -0.02, 0.003, -0.0004, 0}};
  mount.X_BV = {exp_so3({0.3, -1.1, 0.7}), {0.1, -0.2, 0.3}};
  mount.time_shift = std::chrono::microseconds(-12'345);
  TemporaryFolder folder;
  const auto all = value_of(
      read_kalibr_camchain(folder.write("chain.yaml", to_kalibr_camchain({mount, mount}, "test"))));
  ASSERT_EQ(all.size(), 2U);
  const CameraMount& read = all[1];
  EXPECT_LT((read.X_BV.p - mount.X_BV.p).norm(), 1e-9);
  EXPECT_LT(angle_between(read.X_BV.q, mount.X_BV.q), 1e-9);
  EXPECT_EQ(read.time_shift, mount.time_shift);
  EXPECT_EQ(read.model.distortion, mount.model.distortion);
  EXPECT_EQ(read.model.coefficients, mount.model.coefficients);
}

}  // namespace
}  // namespace fiducap
