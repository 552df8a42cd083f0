// Conditions of a body, its restart after a failure, and the report of its calibration.
#include "body_worker_fixture.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// IMU readings in g up to 9 s, then in m/s².
std::vector<SensorSample> in_g_at_first() {
  std::vector<SensorSample> samples;
  for (int t = 1000; t < 30'000; t += 10) {
    const double noise = 1e-3 * (t % 70);  // equal readings would be another fault
    samples.emplace_back(
        ImuSample{ms(t), Eigen::Vector3d::Zero(), {noise, 0, t < 9000 ? 1 : 9.81}});
    if (t % 100 == 0) samples.emplace_back(frame_at(ms(t)));
  }
  return samples;
}

/// An IMU that gives no readings from 2 s to 6 s, and a few images.
std::vector<SensorSample> silent_for_4_s() {
  std::vector<SensorSample> samples;
  for (int t = 1000; t < 8000; t += 10) {
    if (t < 2000 || t > 6000) samples.emplace_back(imu_at(ms(t)));
    if (t == 1500 || t == 2900 || t == 3300 || t == 7000) samples.emplace_back(frame_at(ms(t)));
  }
  return samples;
}

TEST_F(BodyWorkerTest, EndsTheConditionOfARepairedImu) {
  std::atomic<int> images_done{0};
  build(paced(in_g_at_first(), images_done));
  std::vector<std::size_t> standing;
  filter_->on_image = [&](int done) {
    images_done = done;
    if (done == 70 || done == 280) standing.push_back(events_.standing().size());
  };
  run_together();
  EXPECT_THAT(standing, ElementsAre(1U, 0U));
  const Event begin = events_.after(0).at(0);
  EXPECT_EQ(begin.kind, "imu_readings");
  EXPECT_EQ(begin.severity, Severity::kError);
  EXPECT_THAT(begin.text, HasSubstr("9.80665"));
}

TEST_F(BodyWorkerTest, ReadsOnAfterAnExceptionOfADriver) {
  build(giving(one_image(), 3));
  EXPECT_NO_THROW(run());
  EXPECT_EQ(log_.updated.size(), 1u);
  EXPECT_THAT(events_.after(0),
              Contains(AllOf(Field(&Event::kind, "source_failed"),
                             Field(&Event::text, HasSubstr("the driver threw")))));
  EXPECT_THAT(events_.standing(), Not(Contains(Field(&Event::kind, "source_failed"))));
}

TEST_F(BodyWorkerTest, RestartsAfterAnExceptionOfTheFilter) {
  int images = 0;
  build(made([&](int k) -> MadeSource::Sample {
    const auto events = events_.after(0);
    if (!events.empty() && events.back().over) return std::nullopt;
    if (k % 2 == 0) return imu_at(ms(1000 + 5 * k));
    return frame_at(ms(1000 + 5 * k - 2), {4 + images++ % 2});
  }));
  filter_->throws_at = 3;
  run_together();
  EXPECT_EQ(worker_->statistics().restarts, 1U);
  const auto events = events_.after(0);
  ASSERT_EQ(events.size(), 2U);
  EXPECT_THAT(events[0].sentence(), HasSubstr("robot: estimator failed (a matrix is"));
  EXPECT_EQ(events[1].sentence(), "robot: is tracked again");
}

TEST_F(BodyWorkerTest, KeepsItsStatisticsAfterARestart) {
  build_three_images();
  filter_->throws_at = 1;
  worker_->read(0, {});
  clock_.advance(std::chrono::milliseconds(500));  // two of three are too old by now
  worker_->work({});
  EXPECT_EQ(worker_->statistics().restarts, 1U);
  EXPECT_EQ(worker_->statistics().images_dropped, 2U);
  EXPECT_EQ(worker_->statistics().pipeline.skipped, 2U);
  EXPECT_EQ(worker_->statistics().pipeline.imu_samples, log_.propagated.size());
}

TEST_F(BodyWorkerTest, EndsConditionsWithItsSource) {
  build(giving({}, 1));
  run();
  ASSERT_FALSE(events_.after(0).empty());
  EXPECT_EQ(events_.after(0).front().kind, "source_failed");
  EXPECT_THAT(events_.standing(), IsEmpty());

  build(one_image());
  filter_->throws_at = log_.updated.size() + 1;
  run();
  EXPECT_THAT(events_.standing(), IsEmpty());
  EXPECT_EQ(events_.after(0).back().kind, "failed");
  EXPECT_EQ(events_.after(0).back().text, "its source has ended");
}

TEST_F(BodyWorkerTest, ChecksTheImuAgainAfterARestart) {
  build(silent_for_4_s());
  filter_->throws_at = 3;
  run();
  EXPECT_EQ(worker_->statistics().restarts, 1U);
  EXPECT_THAT(silences(), ElementsAre("silent", HasSubstr("estimator restarts")));
}

TEST_F(BodyWorkerTest, RestartsWithGrowingDelays) {
  const Instant begin = clock_.now();
  build(made([&](int k) -> MadeSource::Sample {
    if (clock_.now() - begin > std::chrono::seconds(120)) return std::nullopt;
    if (k % 2 == 0) return imu_at(ms(1000 + 5 * k));
    return frame_at(ms(1000 + 5 * k - 2));
  }));
  fails_always_ = true;
  filter_->throws_at = 1;
  run_together();
  EXPECT_LE(worker_->statistics().restarts, 13U) << "100 ms, 200 ms, … 30 s, 30 s";
  EXPECT_GE(worker_->statistics().restarts, 9U);
  ASSERT_EQ(events_.after(0).size(), 2U) << "the condition and its end";
  EXPECT_EQ(events_.after(0)[1].text, "its source has ended");
}

CameraMount rough_mount() {
  CameraMount mount;
  mount.position_sigma_m = 0.01;
  mount.rotation_sigma_rad = 0.01;
  mount.time_shift_sigma_s = 0.02;
  return mount;
}

ExtrinsicsEstimate learned(double position_m, double rotation_rad, double shift_sigma_s) {
  ExtrinsicsEstimate camera;
  camera.covariance.diagonal().head<3>().setConstant(position_m * position_m / 3);
  camera.covariance.diagonal().tail<3>().setConstant(rotation_rad * rotation_rad / 3);
  camera.clock.shift_s = 0.03124;
  camera.clock.shift_sigma_s = shift_sigma_s;
  return camera;
}

TEST(CalibrationReport, ShowsAllSigmas) {
  EXPECT_EQ(calibration_text(0, learned(0.002, 0.0004, 0.0001), rough_mount()),
            "camera 0: position ±2 mm, rotation ±0.4 mrad, clock +31.24 ±0.1 ms");
}

TEST(CalibrationReport, ShowsALearnedLens) {
  ExtrinsicsEstimate camera = learned(0.002, 0.0004, 0.0001);
  camera.lens = {{0.0812, {0, 0}}, 0.0012, {0.5, 0.5}};
  EXPECT_EQ(calibration_text(0, camera, rough_mount()),
            "camera 0: position ±2 mm, rotation ±0.4 mrad, clock +31.24 ±0.1 ms, focal length "
            "+8.12 ±0.12 %");
  camera.lens.offset.k1 = -0.05;
  camera.lens.k1_sigma = 0.003;
  EXPECT_TRUE(calibration_text(0, camera, rough_mount()).ends_with(", k1 -0.050 ±0.003"));
  CameraMount guessed = rough_mount();
  guessed.k1_sigma = 0.1;
  camera.lens.k1_sigma = 0.09;
  EXPECT_THAT(calibration_text(0, camera, guessed), Not(HasSubstr("k1"))) << "not shown";
  guessed.focal_sigma = 0.1;
  camera.lens.focal_sigma = 0.09;
  EXPECT_THAT(calibration_text(0, camera, guessed), HasSubstr("lens not shown"));
}

TEST(CalibrationReport, NamesUnobservedParameters) {
  EXPECT_THAT(calibration_text(1, learned(0.017, 0.0004, 0.019), rough_mount()),
              AllOf(HasSubstr("position not shown by this motion (turn the body about two axes)"),
                    HasSubstr("clock not shown")));
}

TEST(CalibrationReport, NamesExactParameters) {
  CameraMount exact = rough_mount();
  exact.position_sigma_m = 0;
  ExtrinsicsEstimate camera = learned(0, 0.0004, 0);
  camera.clock.readout_s = 0.015;
  camera.clock.readout_sigma_s = 0.0005;
  EXPECT_EQ(calibration_text(0, camera, exact),
            "camera 0: position taken as exact, rotation ±0.4 mrad, readout 15.00 ±0.5 ms");
}

}  // namespace
}  // namespace fiducap
