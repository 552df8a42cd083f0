#include <gtest/gtest.h>

#include <random>

#include "base/pose.hpp"
#include "estimation/checks/scale_fit.hpp"
#include "known_motion.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

using Fit = ScaleFit<4>;

constexpr double kWorstCost = 6.0;
constexpr double kSigma_m = 0.01;

/// Sightings of a tag from a path of some metres; the unknowns are κ and the tag's position.
Fit sightings(double scale, double noise_m, std::uint64_t seed, double path_m = 1.0) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss;
  Fit fit;
  for (int k = 0; k < 40; ++k) {
    const double s = 0.05 * k;
    const Eigen::Vector3d at(path_m * std::sin(s), path_m * s * s, 0.3 * path_m * s);
    Fit::Columns J = Fit::Columns::Zero();
    J.col(0) = -at;
    J.rightCols<3>().setIdentity();
    const Eigen::Vector3d noise(gauss(random), gauss(random), gauss(random));
    const Eigen::Vector3d z = (Eigen::Vector3d(3, 1, 2) - at) / scale + noise_m * noise;
    fit.add(J, z, Eigen::Matrix3d::Identity() / (kSigma_m * kSigma_m));
  }
  return fit;
}

const Fit::Vector kNoPrior = Fit::Vector::Constant(1e-9);

TEST(ScaleFit, HasAConsistentSigma) {
  double squares = 0;
  double sum = 0;
  constexpr int kSeeds = 200;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const auto found = value_of(sightings(1.1, kSigma_m, static_cast<std::uint64_t>(seed), 0.5)
                                    .solve(kNoPrior, kWorstCost));
    const double off = (found.value - std::log(1.1)) / found.sigma;
    squares += off * off;
    sum += off;
  }
  // Chi-square with 200 degrees of freedom: 99.9 % of the means lie between 0.70 and 1.36; a mean
  // of 200 below 0.25.
  EXPECT_GT(squares / kSeeds, 0.70);
  EXPECT_LT(squares / kSeeds, 1.36);
  EXPECT_LT(std::abs(sum / kSeeds), 0.25);
}

TEST(ScaleFit, GivesNothingWithoutMotionForABadFitOrAfterAFewSightings) {
  EXPECT_FALSE(sightings(1.25, kSigma_m, 1, 1e-3).solve(kNoPrior, kWorstCost));
  EXPECT_FALSE(sightings(1.0, 10 * kSigma_m, 1).solve(kNoPrior, kWorstCost));
  Fit fit;
  for (int k = 0; k < 7; ++k) {
    Fit::Columns J = Fit::Columns::Zero();
    J.col(0) = Eigen::Vector3d(k, 0.5 * k, 1);
    J.rightCols<3>().setIdentity();
    fit.add(J, J.col(0), Eigen::Matrix3d::Identity() * 1e6);
  }
  EXPECT_FALSE(fit.solve(kNoPrior, kWorstCost));
}

TEST(ScaleScore, IsTheMedianOfTheLastLooks) {
  ScaleScore score({4, 0.03});
  for (const double value : {0.10, 0.09, 0.11, 0.10, 0.10, -2.0, 1.5}) score.add({value, 0.02});
  ASSERT_TRUE(score.result());
  EXPECT_NEAR(score.result()->value, 0.10, 1e-9);
  for (int k = 0; k < 64; ++k) score.add({k < 32 ? 0.3 : 0.0, 0.01});
  EXPECT_EQ(score.looks(), 32u);
  EXPECT_NEAR(score.result()->value, 0, 1e-9);
}

TEST(ScaleScore, GivesNothingBeforeEnoughLooks) {
  ScaleScore score({4, 0.03});
  EXPECT_FALSE(score.guess());
  for (int k = 0; k < 3; ++k) score.add({0.2, 0.01});
  EXPECT_FALSE(score.result());
  EXPECT_TRUE(score.guess());
  score.add({0.2, 0.01});
  EXPECT_TRUE(score.result());
}

TEST(ScaleScore, HasALargerSigmaWhenLooksDisagree) {
  ScaleScore agreed({4, 0.03});
  ScaleScore torn({4, 0.03});
  for (int k = 0; k < 10; ++k) {
    agreed.add({0.1, 0.01});
    torn.add({k % 2 == 0 ? 0.3 : -0.1, 0.01});
  }
  EXPECT_GT(torn.result()->sigma, 2 * agreed.result()->sigma);
  EXPECT_DOUBLE_EQ(agreed.agreement(0.1), 1.0);
  EXPECT_NEAR(torn.agreement(0.1), 0.5, 1e-9);
}

void restart(MotionWindow& window) {
  window.restart(at_s(0), Motion::q(0), Eigen::Vector3d::Zero(), {0, 0, -kGravity});
}

/// Two seconds of Motion, the accelerometer off by `bias_f`.
MotionWindow moved(const Eigen::Vector3d& bias_f = Eigen::Vector3d::Zero()) {
  MotionWindow window((ImuNoise()));
  for (int k = 0; k <= 400; ++k) {
    ImuSample imu = Motion::imu(0.005 * k);
    imu.f_B += bias_f;
    window.push(imu);
    if (k == 0) restart(window);
    EXPECT_TRUE(window.move_to(at_s(0.005 * k)));
  }
  return window;
}

// Readings at 200 Hz, halfway between two held: a tenth of a millimetre after 2 s.
constexpr double kIntegration_m = 2e-4;

TEST(MotionWindow, FollowsTheBodyUpToItsFirstVelocity) {
  const MotionWindow window = moved();
  EXPECT_DOUBLE_EQ(window.seconds(), 2.0);
  const Eigen::Vector3d way = Motion::p(2) - Motion::p(0) - 2 * Motion::v(0);
  EXPECT_LT((window.way() - way).norm(), kIntegration_m);
  EXPECT_LT((window.speed() - (Motion::v(2) - Motion::v(0))).norm(), kIntegration_m);
  EXPECT_LT(angle_between(window.q_WB(), Motion::q(2)), kIntegration_m);
}

TEST(MotionWindow, IncludesTheEffectOfABias) {
  constexpr double kStep = 1e-3;
  const MotionWindow window = moved();
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
    const Eigen::Vector3d difference = (moved(step).way() - moved(-step).way()) / (2 * kStep);
    EXPECT_LT((window.way_by_bias().col(axis) - difference).norm(), 1e-6) << axis;
  }
}

TEST(MotionWindow, IsNotUsedWithAGapOrASaturatedReading) {
  MotionWindow window((ImuNoise()));
  const auto step = [&](double t) {
    window.push(Motion::imu(t));
    return window.move_to(at_s(t));
  };
  window.push(Motion::imu(0));
  restart(window);
  EXPECT_TRUE(step(0.005));
  EXPECT_FALSE(step(0.1));
  EXPECT_FALSE(step(0.105));

  ImuNoise noise;
  noise.gyro_range_rad_s = 0.5;
  MotionWindow saturated(noise);
  saturated.push(Motion::imu(0));
  restart(saturated);
  ImuSample imu = Motion::imu(0.005);
  imu.w_WB_B = imu.w_WB_B.cwiseMin(0.5).cwiseMax(-0.5);
  saturated.push(imu);
  EXPECT_FALSE(saturated.move_to(at_s(0.005)));
}

}  // namespace
}  // namespace fiducap
