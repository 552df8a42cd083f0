// A tracker whose body the map corrects: what clients see of it.
#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "base/pose.hpp"
#include "pipeline/body_tracker.hpp"
#include "support/allocation_counter.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;

constexpr double kRounding = 1e-9;
constexpr double kSigma_m = 0.003;
constexpr double kRate_hz = 100;

Instant at_ms(int ms) { return instant_from_ns(1'000'000'000) + std::chrono::milliseconds(ms); }

/// A body with IMU at rest far from the origin, images every 50 ms that come 30 ms late.
class RampedTrackerTest : public testing::Test {
 protected:
  using Change = std::function<void(UpdateReport&)>;

  explicit RampedTrackerTest(double ramp_s = 2)
      : tracker_(7, X_BP_, BodyLimits{}, sensors(), EstimatorConfig{}, {.seconds = ramp_s}) {}

  static BodySensors sensors() {
    BodySensors s;
    s.imu = ImuNoise{};
    return s;
  }
  BodyEstimate estimate(int ms) const {
    BodyEstimate e;
    e.at = at_ms(ms);
    e.X_WB = X_WB_;
    e.covariance = Matrix15d::Identity() * kSigma_m * kSigma_m;
    e.anchored = true;
    return e;
  }
  static UpdateReport report(int ms, const Change& change = nullptr) {
    UpdateReport r;
    r.exposed_at = at_ms(ms);
    r.tags_seen = r.tags_used = 3;
    r.running = true;
    if (change) change(r);
    return r;
  }
  void rest_until(int ms) {
    for (; imu_ms_ <= ms; imu_ms_ += 5)
      tracker_.add_imu(
          {at_ms(imu_ms_), Vector3d::Zero(), X_WB_.q.conjugate() * Vector3d(0, 0, 9.81)});
  }
  void image(int ms, const Change& change = nullptr) {
    rest_until(ms + 30);
    tracker_.ingest(estimate(ms), report(ms, change), std::chrono::milliseconds(20), 0);
  }
  /// The map turns about the origin, a long way off, and moves a little.
  void image_with_correction(int ms, const Pose& X_new_old, int generation = 0) {
    X_WB_ = X_new_old * X_WB_;
    image(ms, [&](UpdateReport& r) {
      r.generation = generation;
      r.map_shift = X_new_old;
    });
  }
  [[nodiscard]] BodyPose sample(int ms) const {
    BodyPose pose;
    tracker_.sample(at_ms(ms), pose);
    return pose;
  }
  [[nodiscard]] Vector3d error(const BodyPose& pose) const {
    return pose.X_WP.p - (X_WB_ * X_BP_).p;
  }
  [[nodiscard]] double error_m(int ms) const { return error(sample(ms)).norm(); }

  const Pose X_BP_{exp_so3({0.3, 0, 0}), {0.1, -0.2, 0.05}};
  Pose X_WB_{exp_so3({0.2, 0.1, -2}), {300, -200, 3}};
  const Pose correction_{exp_so3({0, 0, 1e-4}), {0.005, 0, -0.003}};
  BodyTracker tracker_;
  int imu_ms_{0};
};

TEST_F(RampedTrackerTest, ACorrectionBeginsAtThePublishedPose) {
  image(100);
  image(150);
  const BodyPose before = sample(230);
  image_with_correction(200, correction_);
  const BodyPose after = sample(230);
  EXPECT_GT(error(before).norm(), 0.02) << "to be ramped";
  EXPECT_LT((after.X_WP.p - before.X_WP.p).norm(), kRounding);
  EXPECT_LT(angle_between(after.X_WP.q, before.X_WP.q), kRounding);
  EXPECT_TRUE(after.valid);
  EXPECT_LT((after.v_WP - before.v_WP).norm(), 1e-3) << "without that of the ramp";
}

TEST_F(RampedTrackerTest, NoFrameMovesByASigmaAndTheTruthIsWithin) {
  image(100);
  BodyPose before = sample(130);
  int last_moved_ms = 0;
  for (int ms = 140; ms < 5000; ms += static_cast<int>(1000 / kRate_hz)) {
    const int exposed_ms = ms - 30;
    if (exposed_ms % 1000 == 0 && exposed_ms < 2500) {
      image_with_correction(exposed_ms, correction_);
    } else if (exposed_ms % 50 == 0) {
      image(exposed_ms);
    }
    const BodyPose now = sample(ms);
    ASSERT_TRUE(now.valid) << ms;
    ASSERT_LT((now.X_WP.p - before.X_WP.p).norm(), now.position_sigma_m()) << ms;
    ASSERT_LT(angle_between(now.X_WP.q, before.X_WP.q), now.rotation_sigma_rad()) << ms;
    ASSERT_LT(squared_distance(error(now), now.covariance.topLeftCorner<3, 3>()), 1.0) << ms;
    if (error(now).norm() > kRounding) last_moved_ms = ms;
    before = now;
  }
  EXPECT_GT(last_moved_ms, 3500);
  EXPECT_LT(last_moved_ms, 4200) << "two seconds after the last one";
}

TEST_F(RampedTrackerTest, TheRampContinuesWhileCoasting) {
  image(100);
  image_with_correction(150, correction_);
  EXPECT_GT(error_m(200), 0.02);
  rest_until(2200);
  EXPECT_EQ(sample(2200).state, BodyState::kCoasting);
  EXPECT_LT(error_m(2200), 1e-6);
}

TEST_F(RampedTrackerTest, APoseAfterInvalidOnesIsNotRamped) {
  image_with_correction(100, correction_);
  EXPECT_LT(error_m(130), kRounding) << "the first image";
  tracker_.source_lost();
  image_with_correction(150, correction_);
  EXPECT_LT(error_m(180), kRounding) << "was lost";
}

TEST_F(RampedTrackerTest, AnotherStartEndsTheRamp) {
  const std::vector<Change> changes{[](UpdateReport& r) { r.generation = 2; },
                                    [](UpdateReport& r) { r.relocalised = true; },
                                    [](UpdateReport& r) { r.start_changed = true; },
                                    [](UpdateReport& r) { r.gauge_shift = Pose{}; }};
  const Change same = [](UpdateReport& r) { r.generation = 1; };
  int ms = 100;
  for (const Change& change : changes) {
    image(ms, same);
    image(ms + 50, same);
    image_with_correction(ms + 100, correction_, 1);
    EXPECT_GT(error_m(ms + 130), 0.02);
    image(ms + 150, [&](UpdateReport& r) {
      r.generation = 1;
      change(r);
    });
    EXPECT_LT(error_m(ms + 180), kRounding);
    ms += 200;
  }
}

TEST_F(RampedTrackerTest, ACorrectionByManySigmasOfAnImageIsRamped) {
  image(100);
  const BodyPose before = sample(180);
  X_WB_.p.x() += 8 * kSigma_m;
  image(150);
  EXPECT_LT((sample(180).X_WP.p - before.X_WP.p).norm(), kRounding);
  rest_until(1200);
  EXPECT_LT(error_m(1200), 1e-6) << "for the required time";
}

TEST_F(RampedTrackerTest, WithoutReadingsACorrectionOfAnImageIsMotion) {
  image(100);
  image_with_correction(150, correction_);
  const Vector3d left = error(sample(400));
  X_WB_.p.x() += 8 * kSigma_m;
  tracker_.ingest(estimate(400), report(400), {}, 0);
  EXPECT_LT((error(sample(400)) - left).norm(), kRounding) << "the rest of the map's stays";
}

TEST_F(RampedTrackerTest, ACorrectionAboveTheLimitsIsNotValidForAMoment) {
  image(100);
  image_with_correction(150, {Eigen::Quaterniond::Identity(), {0.6, 0, 0}});
  EXPECT_FALSE(sample(180).valid);
  for (int ms = 200; ms < 350; ms += 50) image(ms);
  EXPECT_FALSE(sample(370).valid);
  EXPECT_TRUE(sample(390).valid);
  EXPECT_LT(error_m(390), kRounding);
}

TEST_F(RampedTrackerTest, TheLastSeenPositionMovesWithTheMap) {
  image(100);
  tracker_.ingest(std::nullopt, report(200, [&](auto& r) { r.map_shift = correction_; }), {}, 0);
  X_WB_ = correction_ * X_WB_;
  EXPECT_EQ(sample(200).state, BodyState::kLost);
  EXPECT_LT(error_m(200), kRounding);
}

TEST_F(RampedTrackerTest, AllocatesNothing) {
  image(100);
  const BodyEstimate next = estimate(150);
  const UpdateReport r = report(150, [&](auto& change) { change.map_shift = correction_; });
  const AllocationCounter allocations;
  tracker_.ingest(next, r, {}, 0);
  (void)sample(170);
  EXPECT_EQ(allocations.count(), 0u);
}

TEST_F(RampedTrackerTest, WithoutARampACorrectionIsPublishedAtOnce) {
  tracker_ = BodyTracker(7, X_BP_, BodyLimits{}, sensors(), EstimatorConfig{}, {.seconds = 0});
  image(100);
  image_with_correction(150, correction_);
  EXPECT_LT(error_m(180), kRounding);
  EXPECT_NEAR(sample(150).position_sigma_m(), kSigma_m, 0.1 * kSigma_m);
}

}  // namespace
}  // namespace fiducap
