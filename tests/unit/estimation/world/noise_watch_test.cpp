// The noises of IMU and stamps, learned from innovations that are drawn with them.
#include "estimation/world/noise_watch.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <random>

#include "support/jacobian_check.hpp"

namespace fiducap::world {
namespace {

constexpr int kSeeds = 20;
constexpr int kImages = 800;

/// Images whose innovations have covariance S for the filter, plus the contribution of `imu` times
/// the declared variance and a jitter of `jitter_s`.
struct Drawn {
  double imu_variance{};
  double jitter_s{};
  int rests{0};  ///< The body moves at one of `rests` images, at every one when 0.
};

NoiseWatch watched(const Drawn& truth, unsigned seed, NoiseWatch watch = {}) {
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss;
  for (int i = 0; i < kImages; ++i) {
    MotionSinceImage motion;
    motion.begun = true;
    // A millimetre and a millirad since the last image, which the image corrects again.
    motion.Q.topLeftCorner<6, 6>().diagonal().setConstant(1e-6 * watch.imu_variance());
    Vector6d on_time;
    on_time << 0.5 * gauss(random), 0.5 * gauss(random), 0.5, gauss(random), gauss(random), 1.0;
    if (truth.rests > 0 && i % truth.rests != 0) on_time *= 0.01;
    // Of the camera's pose, if measured directly: the filter's model …
    const double variance = 1e-6 + 1e-6 * watch.imu_variance();
    Matrix6d S = Matrix6d::Identity() * variance;
    S += watch.jitter_s() * watch.jitter_s() * on_time * on_time.transpose();
    // … and the truth.
    Matrix6d S_true = Matrix6d::Identity() * (1e-6 + 1e-6 * truth.imu_variance);
    S_true += truth.jitter_s * truth.jitter_s * on_time * on_time.transpose();
    const Vector6d y =
        S_true.llt().matrixL() * Vector6d::NullaryExpr([&] { return gauss(random); });
    StackedUpdate::SharedScore score;
    score.information = inverse(S);
    score.score = score.information * y;
    score.by_known_tags = Matrix6d::Identity() * 1e12;  // corrected to a micrometre
    watch.follow(motion);
    watch.learn(score, on_time);
    watch.correct(score, on_time);
  }
  return watch;
}

/// Expects noises learned with many seeds.
void expect_learned(const Drawn& truth, double variance_error, double jitter_error_s) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const NoiseWatch watch = watched(truth, seed);
    EXPECT_NEAR(watch.imu_variance(), truth.imu_variance, variance_error) << "seed " << seed;
    EXPECT_NEAR(watch.jitter_s(), truth.jitter_s, jitter_error_s) << "seed " << seed;
  }
}

TEST(NoiseWatch, StartsWithTheNoiseOfAnotherFilter) {
  const NoiseWatch before = watched({25.0, 0.0}, 1);
  NoiseWatch after;
  after.begin_with(before.learned());
  EXPECT_EQ(after.imu_variance(), before.imu_variance());
  EXPECT_NEAR(watched({25.0, 0.0}, 2, after).imu_variance(), 25.0, 5.0);
}

TEST(NoiseWatch, RevertsTheLastImages) {
  const NoiseWatch quiet = watched({1.0, 0.0}, 3);
  NoiseWatch watch = quiet;
  watch.take_back();
  EXPECT_EQ(watch.imu_variance(), 1.0);
  EXPECT_GT(watch.learned().information(0, 0), 0.0) << "the older ones stay";
}

TEST(NoiseWatch, NoiseLearnedDuringADoubtIsRevertedUntilTheDoubtEnds) {
  NoiseWatch doubting = watched({1.0, 0.0}, 4);
  doubting.begin_doubt();
  doubting = watched({25.0, 0.0}, 5, doubting);
  ASSERT_GT(doubting.imu_variance(), 10.0);
  NoiseWatch ended = doubting;
  doubting.discard_since_outlier();
  EXPECT_EQ(doubting.imu_variance(), 1.0);
  EXPECT_EQ(doubting.variance_inflation(), 1.0);
  ended.end_doubt();
  ended.discard_since_outlier();
  EXPECT_GT(ended.imu_variance(), 10.0);
}

TEST(NoiseWatch, ReportsTheVarianceInflationUntilItIsForgotten) {
  constexpr double kMostForgotten = 1.2;
  NoiseWatch watch;
  double most = 1;
  for (unsigned seed = 0; seed < 4; ++seed) {
    watch = watched({25.0, 0.0}, seed, watch);
    most = std::max(most, watch.variance_inflation());
  }
  EXPECT_GT(most, 2.0) << "40 s after the noise was applied a seventh of 25 is left";
  EXPECT_LT(watch.variance_inflation(), kMostForgotten) << "160 s";
  for (unsigned seed = 0; seed < kSeeds; ++seed)
    EXPECT_LT(watched({1.0, 0.0}, seed).variance_inflation(), 2.0) << "seed " << seed;
}

TEST(NoiseWatch, DiscardsTheEffectOfAnotherError) {
  NoiseWatch watch = watched({25.0, 0.002}, 6);
  watch.unlearn();
  EXPECT_EQ(watch.imu_variance(), 1.0);
  EXPECT_EQ(watch.jitter_s(), 0.0);
  EXPECT_NEAR(watched({25.0, 0.0}, 2, watch).imu_variance(), 25.0, 5.0) << "and learns again";
}

TEST(NoiseWatch, LearnsTheNoisesOfImuAndStamps) {
  expect_learned({1.0, 0.0}, 0, 0);          // as declared
  expect_learned({25.0, 0.0}, 8.0, 1.5e-3);  // an IMU that is five times as noisy
  expect_learned({1.0, 3e-3}, 1.0, 0.6e-3);  // stamps that jitter
  expect_learned({9.0, 5e-3}, 4.0, 1.2e-3);
}

// A sum of few squares is far from its mean more often than a normal variable.
TEST(NoiseWatch, FewImagesWithMotionDoNotMakeJitter) {
  int wrong = 0;
  for (unsigned seed = 0; seed < 20 * kSeeds; ++seed)
    wrong += watched({1.0, 0.0, kImages / 3}, seed).jitter_s() > 0 ? 1 : 0;
  EXPECT_LE(wrong, 1);
  EXPECT_NEAR(watched({1.0, 3e-3, 4}, 1).jitter_s(), 3e-3, 1e-3) << "true jitter is found";
}

TEST(NoiseWatch, IgnoresNonFiniteNumbers) {
  NoiseWatch watch;
  StackedUpdate::SharedScore score;
  score.information.setConstant(std::numeric_limits<double>::quiet_NaN());
  score.score.setConstant(1.0);
  score.by_known_tags.setIdentity();
  watch.learn(score, Vector6d::Ones());
  EXPECT_EQ(watch.imu_variance(), 1.0);
}

}  // namespace
}  // namespace fiducap::world
