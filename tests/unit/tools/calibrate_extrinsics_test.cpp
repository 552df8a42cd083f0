#include <filesystem>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/pose.hpp"
#include "calibration/extrinsics/camera_imu_calibration.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording_writer.hpp"
#include "simulation/simulation.hpp"
#include "support/temporary_folder.hpp"
#include "tools/calibrate/calibrate.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

constexpr double kStampError_s =
    0.012;  // images say they are later than they are: the shift is negative
constexpr double kTime_s = 0.001;
constexpr double kSigmas = 3.5;  // six numbers: 3 sigma of one is 3.5 of the worst

class CalibrateExtrinsics : public ::testing::Test {
 protected:
  void record(const std::string& motion, double seconds, bool with_imu = true) {
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
    body.trajectory.kind = motion;
    body.trajectory.duration_s = seconds;
    body.faults.image_stamp_error_s = kStampError_s;
    truth_ = camera.X_BV;
    auto source =
        simulation::make_simulated_source(room, body, instant_from_ns(1'000'000'000), nullptr);
    ASSERT_TRUE(source) << source.error().text();
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
    auto writer = RecordingWriter::create(info);
    ASSERT_TRUE(writer) << writer.error().text();
    for (;;) {
      auto sample = (*source)->next({});
      ASSERT_TRUE(sample);
      if (!*sample) break;
      if (!with_imu && std::holds_alternative<ImuSample>(**sample)) continue;
      ASSERT_TRUE(writer->write(**sample));
    }
    ASSERT_TRUE(writer->finish());
  }

  int calibrate() {
    CalibrateExtrinsicsArguments arguments;
    arguments.recording = recording_;
    arguments.out = folder_.file("out");
    arguments.json = true;
    return run_calibrate_extrinsics(arguments, {out_, err_});
  }

  TemporaryFolder folder_;
  std::string recording_{folder_.file("waving")};
  Pose truth_;
  std::ostringstream out_;
  std::ostringstream err_;
};

TEST_F(CalibrateExtrinsics, FindsPlaceAttitudeAndTimeOfTheCamera) {
  record("table", 40);
  ASSERT_EQ(calibrate(), kExitOk) << err_.str();
  const auto camera = nlohmann::json::parse(out_.str())["cameras"][0];
  const auto chain = read_kalibr_camchain(folder_.file("out/camchain-imucam.yaml"));
  ASSERT_TRUE(chain) << chain.error().text();
  ASSERT_EQ(chain->size(), 1U);
  const Pose& found = chain->front().X_BV;
  Eigen::Matrix<double, 6, 1> off;
  off << found.p - truth_.p, log_so3(found.q * truth_.q.conjugate());
  for (int i = 0; i < 6; ++i) {
    const double sigma = camera["sigma_m_rad"][static_cast<std::size_t>(i)].get<double>();
    EXPECT_LT(std::abs(off(i)), kSigmas * sigma) << "axis " << i;
    EXPECT_LT(sigma, i < 3 ? 0.003 : 0.001) << "axis " << i;
  }
  EXPECT_NEAR(to_seconds(chain->front().time_shift), -kStampError_s, kTime_s);
  EXPECT_NEAR(chain->front().model.coefficients[0], -0.28, 1e-9);
}

TEST_F(CalibrateExtrinsics, SaysWhatCannotBeKnownFromARobotThatHardlyMoves) {
  record("table", 1);  // the simulator rests for its first second
  ASSERT_EQ(calibrate(), kExitOk) << err_.str();
  const auto report = nlohmann::json::parse(out_.str());
  EXPECT_EQ(report["verdict"], "weak");
  ASSERT_GE(report["cameras"][0]["not_observed"].size(), 3U);
  EXPECT_THAT(report["cameras"][0]["not_observed"][0]["motion"].get<std::string>(),
              HasSubstr("rotate quickly"));
}

TEST_F(CalibrateExtrinsics, NeedsAnImu) {
  record("table", 3, false);
  EXPECT_EQ(calibrate(), kExitFailed);
  EXPECT_THAT(err_.str(), HasSubstr("no IMU"));
}

TEST(KalibrCamchain, ComesBackAsItWasWritten) {
  CameraMount mount;
  mount.model = {
      640, 400, 300, 301, 320, 200, Distortion::kEquidistant, {0.1, -0.02, 0.003, -0.0004, 0}};
  mount.X_BV = {exp_so3({0.3, -1.1, 0.7}), {0.1, -0.2, 0.3}};
  mount.time_shift = std::chrono::microseconds(-12'345);
  TemporaryFolder folder;
  const auto read =
      read_kalibr_camchain(folder.write("chain.yaml", to_kalibr_camchain({mount, mount}, "test")));
  ASSERT_TRUE(read) << read.error().text();
  ASSERT_EQ(read->size(), 2U);
  EXPECT_LT(((*read)[1].X_BV.p - mount.X_BV.p).norm(), 1e-9);
  EXPECT_LT(angle_between((*read)[1].X_BV.q, mount.X_BV.q), 1e-9);
  EXPECT_EQ((*read)[1].time_shift, mount.time_shift);
  EXPECT_EQ((*read)[1].model.distortion, mount.model.distortion);
  EXPECT_EQ((*read)[1].model.coefficients, mount.model.coefficients);
}

}  // namespace
}  // namespace fiducap
