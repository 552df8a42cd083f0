// A tracker whose body the map corrects: what clients see of it.
#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "base/pose.hpp"
#include "pipeline/body_tracker.hpp"
#include "support/allocation_counter.hpp"

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
  static UpdateReport report(int ms) {
    UpdateReport r;
    r.exposed_at = at_ms(ms);
    r.tags_seen = r.tags_used = 3;
    r.running = true;
    return r;
  }
  void rest_until(int ms) {
    for (; imu_ms_ <= ms; imu_ms_ += 5)
      tracker_.add_imu(
          {at_ms(imu_ms_), Vector3d::Zero(), X_WB_.q.conjugate() * Vector3d(0, 0, 9.81)});
  }
  void image(
      int ms, const std::function<void(UpdateReport&)>& change = [](UpdateReport&) {}) {
    rest_until(ms + 30);
    UpdateReport r = report(ms);
    change(r);
    tracker_.ingest(estimate(ms), r, std::chrono::milliseconds(20), 0);
  }
  /// The map turns about the origin, a long way off, and moves a little.
  void image_with_correction(int ms, const Pose& X_new_old) {
    X_WB_ = X_new_old * X_WB_;
    image(ms, [&](UpdateReport& r) { r.map_shift = X_new_old; });
  }
  [[nodiscard]] BodyPose sample(int ms) const {
    BodyPose pose;
    tracker_.sample(at_ms(ms), pose);
    return pose;
  }
  [[nodiscard]] Pose true_X_WP() const { return X_WB_ * X_BP_; }

  const Pose X_BP_{exp_so3({0.3, 0, 0}), {0.1, -0.2, 0.05}};
  Pose X_WB_{exp_so3({0.2, 0.1, -2}), {300, -200, 3}};
  const Pose correction_{exp_so3({0, 0, 1e-4}), {0.005, 0, -0.003}};
  BodyTracker tracker_;
  int imu_ms_{0};
};

TEST_F(RampedTrackerTest, ThePoseGoesOnFromWhereItWasPublished) {
  image(100);
  image(150);
  const BodyPose before = sample(230);
  image_with_correction(200, correction_);
  const BodyPose after = sample(230);
  EXPECT_GT((true_X_WP().p - before.X_WP.p).norm(), 0.02) << "what is to be ramped";
  EXPECT_LT((after.X_WP.p - before.X_WP.p).norm(), kRounding);
  EXPECT_LT(angle_between(after.X_WP.q, before.X_WP.q), kRounding);
  EXPECT_TRUE(after.valid);
  EXPECT_LT((after.v_WP - before.v_WP).norm(), 1e-3) << "the body's, not that of the ramp";
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
    const Vector3d error = now.X_WP.p - true_X_WP().p;
    ASSERT_LT(error.dot(now.covariance.topLeftCorner<3, 3>().ldlt().solve(error)), 1.0) << ms;
    if (error.norm() > kRounding) last_moved_ms = ms;
    before = now;
  }
  EXPECT_GT(last_moved_ms, 3500);
  EXPECT_LT(last_moved_ms, 4200) << "two seconds after the last one";
}

TEST_F(RampedTrackerTest, CoastingTheRampGoesOn) {
  image(100);
  image_with_correction(150, correction_);
  EXPECT_GT((sample(200).X_WP.p - true_X_WP().p).norm(), 0.02);
  rest_until(2200);
  EXPECT_EQ(sample(2200).state, BodyState::kCoasting);
  EXPECT_LT((sample(2200).X_WP.p - true_X_WP().p).norm(), 1e-6);
}

TEST_F(RampedTrackerTest, WhatWasNotValidNeedsNoRamp) {
  image_with_correction(100, correction_);
  EXPECT_LT((sample(130).X_WP.p - true_X_WP().p).norm(), kRounding) << "the first image";
  tracker_.source_lost();
  image_with_correction(150, correction_);
  EXPECT_LT((sample(180).X_WP.p - true_X_WP().p).norm(), kRounding) << "was lost";
}

TEST_F(RampedTrackerTest, WhatHasNothingToDoWithBeforeIsShownAtOnce) {
  const std::vector<std::function<void(UpdateReport&)>> changes{
      [](UpdateReport& r) { r.generation = 1; },
      [](UpdateReport& r) { r.generation = 1, r.relocalised = true; },
      [](UpdateReport& r) { r.generation = 1, r.start_changed = true; },
      [](UpdateReport& r) { r.generation = 1, r.gauge_shift = Pose{}; }};
  int ms = 100;
  for (const auto& change : changes) {
    const auto same = [](UpdateReport& r) { r.generation = 1; };
    image(ms, same);
    image(ms + 50, same);
    X_WB_ = correction_ * X_WB_;
    image(ms + 100, [&](UpdateReport& r) {
      r.generation = 1;
      r.map_shift = correction_;
    });
    EXPECT_GT((sample(ms + 130).X_WP.p - true_X_WP().p).norm(), 0.02);
    image(ms + 150, [&](UpdateReport& r) {
      change(r);
      if (&change == &changes.front()) r.generation = 2;
    });
    EXPECT_LT((sample(ms + 180).X_WP.p - true_X_WP().p).norm(), kRounding);
    ms += 200;
  }
}

TEST_F(RampedTrackerTest, AnImageThatMovesABodyByManySigmasIsRampedToo) {
  image(100);
  const BodyPose before = sample(180);
  X_WB_.p.x() += 8 * kSigma_m;
  image(150);
  EXPECT_LT((sample(180).X_WP.p - before.X_WP.p).norm(), kRounding);
  rest_until(1200);
  EXPECT_LT((sample(1200).X_WP.p - true_X_WP().p).norm(), 1e-6) << "as long as it has to be";
}

TEST_F(RampedTrackerTest, WithoutReadingsWhatAnImageChangesIsMotion) {
  image(100);
  image_with_correction(150, correction_);
  const BodyPose before = sample(400);
  const Vector3d left = before.X_WP.p - true_X_WP().p;
  X_WB_.p.x() += 8 * kSigma_m;
  tracker_.ingest(estimate(400), report(400), {}, 0);
  EXPECT_LT((sample(400).X_WP.p - true_X_WP().p - left).norm(), kRounding)
      << "what is left of the map's stays";
}

TEST_F(RampedTrackerTest, WhatDoesNotFitIntoTheLimitsIsAwayForAMomentAndRightAtOnce) {
  image(100);
  image_with_correction(150, {Eigen::Quaterniond::Identity(), {0.6, 0, 0}});
  EXPECT_FALSE(sample(180).valid);
  for (int ms = 200; ms < 350; ms += 50) image(ms);
  EXPECT_FALSE(sample(370).valid);
  const BodyPose pose = sample(390);
  EXPECT_TRUE(pose.valid);
  EXPECT_LT((pose.X_WP.p - true_X_WP().p).norm(), kRounding);
}

TEST_F(RampedTrackerTest, WhereItWasSeenLastMovesWithTheMap) {
  image(100);
  UpdateReport r = report(200);
  r.map_shift = correction_;
  tracker_.ingest(std::nullopt, r, {}, 0);
  X_WB_ = correction_ * X_WB_;
  EXPECT_EQ(sample(200).state, BodyState::kLost);
  EXPECT_LT((sample(200).X_WP.p - true_X_WP().p).norm(), kRounding);
}

TEST_F(RampedTrackerTest, AllocatesNothing) {
  image(100);
  const BodyEstimate next = estimate(150);
  UpdateReport r = report(150);
  r.map_shift = correction_;
  const AllocationCounter allocations;
  tracker_.ingest(next, r, {}, 0);
  (void)sample(170);
  EXPECT_EQ(allocations.count(), 0u);
}

class UnrampedTrackerTest : public RampedTrackerTest {
 protected:
  UnrampedTrackerTest() : RampedTrackerTest(0) {}
};

TEST_F(UnrampedTrackerTest, ZeroSecondsPublishTheCorrectionAtOnce) {
  image(100);
  image_with_correction(150, correction_);
  EXPECT_LT((sample(180).X_WP.p - true_X_WP().p).norm(), kRounding);
  EXPECT_NEAR(sample(150).position_sigma_m(), kSigma_m, 0.1 * kSigma_m);
}

}  // namespace
}  // namespace fiducap
