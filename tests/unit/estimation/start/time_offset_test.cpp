// The clock offset and the axes of a camera by its rotations: exact motions, noise on the corners.
#include "estimation/start/time_offset.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "support/allocation_counter.hpp"
#include "unit/estimation/example_tags.hpp"

namespace fiducap {
namespace {

using std::numbers::pi;

constexpr double kExact_rad = 1e-6;
constexpr double kCornerNoise_px = 0.4;
const CameraModel kCamera{752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};

Instant instant_at(double t_s) { return instant_from_ns(1'000'000'000) + from_seconds(t_s); }

TEST(GyroIntegral, GivesTheRotationOfAnySpan) {
  GyroIntegral gyro;
  for (int i = 0; i < 800; ++i) gyro.add({instant_at(0.005 * i), {0.1, 0.2, -0.3}, {0, 0, 9.81}});
  ASSERT_TRUE(gyro.covers(instant_at(1.2341), instant_at(1.7341)));
  const Eigen::Vector3d turn = gyro.turn(instant_at(1.2341), instant_at(1.7341));
  EXPECT_LT((turn - Eigen::Vector3d(0.05, 0.1, -0.15)).norm(), kExact_rad);
  EXPECT_FALSE(gyro.covers(instant_at(3.5), instant_at(4.1))) << "not yet known";
}

TEST(GyroIntegral, IncludesTheSecondOrderOfTurningAxes) {
  // A cone: the rates' integral alone is wrong by the area that they enclose.
  GyroIntegral gyro;
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  const auto rate = [](double t_s) {
    return Eigen::Vector3d(std::cos(6 * t_s), std::sin(6 * t_s), 0.5);
  };
  constexpr double kStep_s = 0.001;
  for (int i = 0; i <= 1300; ++i) {
    gyro.add({instant_at(kStep_s * i), rate(kStep_s * i), {0, 0, 9.81}});
    if (i >= 1000 && i < 1300) q = q * exp_so3(kStep_s * rate(kStep_s * (i + 0.5)));
  }
  const Eigen::Vector3d turn = gyro.turn(instant_at(1), instant_at(1.3));
  constexpr double kThirdOrder_rad = 0.003;
  EXPECT_LT((turn - log_so3(q)).norm(), kThirdOrder_rad);
  EXPECT_GT((turn - 0.3 * rate(1.15)).norm(), kThirdOrder_rad);
}

TEST(GyroIntegral, GivesNothingAcrossAPauseOrASaturation) {
  GyroIntegral gyro(4.0);
  const auto run = [&](double from_s, double to_s) {
    for (double t_s = from_s; t_s < to_s; t_s += 0.005)
      gyro.add({instant_at(t_s), {0.5, 0, 0}, {0, 0, 9.81}});
  };
  run(0, 1);
  run(1.2, 2);
  EXPECT_FALSE(gyro.covers(instant_at(0.9), instant_at(1.5)));
  EXPECT_TRUE(gyro.covers(instant_at(1.3), instant_at(1.5)));
  gyro.add({instant_at(2), {0, 4.0, 0}, {0, 0, 9.81}});
  run(2.005, 2.5);
  EXPECT_FALSE(gyro.covers(instant_at(1.9), instant_at(2.2)));
  EXPECT_TRUE(gyro.covers(instant_at(2.1), instant_at(2.2)));
}

/// A camera in front of two tags with an IMU in it.
class TimeOffsetTest : public testing::Test {
 protected:
  /// Turns little about where it starts, so that the tags stay in view.
  [[nodiscard]] Eigen::Quaterniond attitude(double t_s) const {
    const Eigen::Vector3d turn(0.25 * std::sin(2.1 * t_s), 0.25 * std::sin(2.9 * t_s + 1),
                               0.4 * std::sin(1.7 * t_s));
    return exp_so3(turn.cwiseProduct(about_));
  }
  TagObservations image(double t_s) {
    const Pose X_WV{attitude(t_s), {0.05 * std::sin(t_s), 0, 0}};
    TagObservations seen;
    seen.exposed_at = instant_at(t_s + stamp_error_s_);
    for (int id = 0; id < 2; ++id) {
      const Pose X_WT{exp_so3({pi - 0.6, 0.2, 0}), {0.3 * id - 0.15, 0, 1.2}};
      seen.tags.push_back(
          noisy_observation(id, 0.2, X_WV.inverse() * X_WT, kCamera, kCornerNoise_px, random_));
    }
    return seen;
  }
  void run(double seconds) {
    for (const double end_s = t_s_ + seconds; t_s_ < end_s; t_s_ += 0.005) {
      constexpr double kStep_s = 1e-4;
      const Eigen::Vector3d rate =
          log_so3(attitude(t_s_ - kStep_s).conjugate() * attitude(t_s_ + kStep_s)) / (2 * kStep_s);
      gyro_.add({instant_at(t_s_), unit_ * axes_ * rate, {0, 0, 9.81}});
      if (tick_++ % 10 == 0) offset_.add(image(t_s_), gyro_);
    }
  }
  [[nodiscard]] OffsetFit fit(Axes axes) const { return offset_.fit(axes, {}, TimeOffset::kTurns); }

  Eigen::Vector3d about_{Eigen::Vector3d::Ones()};
  double stamp_error_s_{0};
  double unit_{1};
  Eigen::Matrix3d axes_{Eigen::Matrix3d::Identity()};
  TimeOffset offset_{kCamera, Eigen::Quaterniond::Identity(), kCornerNoise_px};
  GyroIntegral gyro_;
  std::mt19937 random_{3};
  double t_s_{0};
  int tick_{0};
};

TEST_F(TimeOffsetTest, FindsAnyOffsetWithAnHonestSigma) {
  double nees = 0;
  constexpr std::array kOffsets_s{-0.6, -0.2, -0.05, -0.004, 0.0, 0.013, 0.03, 0.1, 0.35, 0.7};
  for (const double off_s : kOffsets_s) {
    stamp_error_s_ = -off_s;
    offset_.forget_all();
    run(12);
    const OffsetFit found = fit(Axes::kConfigured);
    EXPECT_TRUE(found.explains());
    EXPECT_TRUE(found.is_unique) << off_s;
    EXPECT_LT(found.shift_sigma_s, 0.006);
    const double sigmas = (found.shift_s - off_s) / found.shift_sigma_s;
    EXPECT_LT(std::abs(sigmas), 4) << off_s;
    nees += sigmas * sigmas / kOffsets_s.size();
  }
  EXPECT_LT(nees, 2.5);
}

TEST_F(TimeOffsetTest, APriorOutweighsAWeakMeasurement) {
  about_.setConstant(0.3);
  run(12);
  constexpr ClockPrior kPrior{0.01, 1e-4};
  const OffsetFit found = offset_.fit(Axes::kConfigured, kPrior, TimeOffset::kTurns);
  EXPECT_NEAR(found.shift_s, kPrior.shift_s, kPrior.sigma_s);
  EXPECT_LE(found.shift_sigma_s, kPrior.sigma_s);
}

TEST_F(TimeOffsetTest, DistinguishesTurnedFromReflectedAxes) {
  constexpr double kTolerance = 0.15;
  for (const Eigen::Vector3d& turn :
       {Eigen::Vector3d(pi / 2, 0, 0), Eigen::Vector3d(0, 0, pi), Eigen::Vector3d(0.4, 0.4, 0)}) {
    axes_ = exp_so3(turn).toRotationMatrix();
    offset_.forget_all();
    run(12);
    const OffsetFit found = fit(Axes::kTurned);
    EXPECT_TRUE(found.explains());
    EXPECT_LT((found.A - axes_).norm(), kTolerance);
    EXPECT_LT(found.cost + kOffsetEvidence, fit(Axes::kConfigured).cost);
    EXPECT_LT(found.cost + kOffsetEvidence, fit(Axes::kReflected).cost);
  }
  axes_ << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  offset_.forget_all();
  run(12);
  EXPECT_LT((fit(Axes::kReflected).A - axes_).norm(), kTolerance);
  EXPECT_LT(fit(Axes::kReflected).cost + kOffsetEvidence, fit(Axes::kTurned).cost);
}

TEST_F(TimeOffsetTest, SmallErrorsOfTheAxesAreAsConfigured) {
  axes_ = exp_so3({0.05, -0.06, 0.04}).toRotationMatrix();
  run(12);
  EXPECT_TRUE(fit(Axes::kConfigured).explains());
  EXPECT_LT(fit(Axes::kConfigured).cost, fit(Axes::kTurned).cost + kOffsetEvidence);
}

TEST_F(TimeOffsetTest, OneAxisDoesNotDistinguishRotationFromReflection) {
  about_ = {0, 0, 1};
  axes_ = exp_so3({pi / 2, 0, 0}).toRotationMatrix();
  run(12);
  const double rotated = fit(Axes::kTurned).cost;
  EXPECT_LT(rotated + kOffsetEvidence, fit(Axes::kConfigured).cost);
  EXPECT_LT(std::abs(rotated - fit(Axes::kReflected).cost), kOffsetEvidence);
}

TEST_F(TimeOffsetTest, FindsSamplesInDegrees) {
  run(12);
  EXPECT_FALSE(offset_.fit_degrees(0, TimeOffset::kTurns).explains());
  unit_ = 1 / kDegree;
  offset_.forget_all();
  run(12);
  EXPECT_TRUE(offset_.fit_degrees(0, TimeOffset::kTurns).explains());
  EXPECT_FALSE(fit(Axes::kConfigured).explains());
}

TEST_F(TimeOffsetTest, AFifthOfImagesWithAMovedTagHaveNoInfluence) {
  stamp_error_s_ = -0.1;
  run(3);
  for (int i = 0; i < 5; ++i) {
    TagObservations moved = image(t_s_);
    const Pose X_VT{exp_so3({pi - 0.2, -0.4, 0.3}), {0, 0, 1.0}};
    for (TagObservation& tag : moved.tags)
      tag = noisy_observation(tag.tag_id, 0.2, X_VT, kCamera, kCornerNoise_px, random_);
    offset_.add(moved, gyro_);
    run(1.5);
  }
  EXPECT_NEAR(fit(Axes::kConfigured).shift_s, 0.1, 0.015);
}

TEST_F(TimeOffsetTest, ABodyThatHardlyTurnsShowsNothing) {
  about_.setConstant(0.02);
  run(12);
  EXPECT_EQ(offset_.turns(), 0u);
  EXPECT_FALSE(fit(Axes::kConfigured).explains());
}

TEST_F(TimeOffsetTest, AllocatesNothingAndIsBounded) {
  run(6);
  const AllocationCounter allocations;
  (void)fit(Axes::kReflected);
  (void)offset_.fit(Axes::kConfigured, {0, 0.02}, TimeOffset::kTurns);
  EXPECT_EQ(allocations.count(), 0u);
  run(20);
  EXPECT_EQ(offset_.turns(), TimeOffset::kTurns);
}

}  // namespace
}  // namespace fiducap
