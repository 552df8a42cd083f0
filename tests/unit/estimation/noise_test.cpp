// The noises of corners, IMU and stamps, learned from data that are drawn with them.
#include "estimation/filter/corner_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include <Eigen/Cholesky>

#include "estimation/world/noise_watch.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

constexpr int kTags = 4000;
constexpr double kWalks_px = 3.0;  // from image to image

/// A tag of an image; `k` images later it has moved.
TagObservation tag_at(int k, double sigma_px = 0) {
  TagObservation seen;
  seen.corner_sigma_px = sigma_px;
  for (auto& px : seen.corners_px) px.x() = kWalks_px * k;
  return seen;
}

const TagObservation kAnyTag{};
const EstimatorConfig kConfig;

/// Distances of tags whose corners scatter with `true_px`, for a filter without other errors.
void learn(CornerNoise& noise, double true_px, double outliers) {
  std::mt19937 random(5);
  std::chi_squared_distribution<double> distance(8);
  std::uniform_real_distribution<double> chance;
  for (int i = 0; i < kTags; ++i) {
    const TagObservation seen = tag_at(i);
    const double ratio = true_px / noise.of(seen);
    noise.learn(seen, chance(random) < outliers ? 1e4 : distance(random) * ratio * ratio, 1.0);
  }
}

TEST(CornerNoise, FindsTheTrueScatterAboveTheErrorsOfLensAndPrint) {
  struct Case {
    double true_px, outliers, tolerance;
  };
  for (const auto& [true_px, outliers, tolerance] : {Case{0.04, 0.0, 0.06},
                                                     {0.15, 0.0, 0.06},
                                                     {0.4, 0.0, 0.06},
                                                     {1.6, 0.0, 0.06},
                                                     {0.4, 0.1, 0.12}}) {
    CornerNoise noise(kConfig, true);
    learn(noise, true_px, outliers);
    EXPECT_NEAR(noise.of(kAnyTag) / true_px, 1.0, tolerance);
  }
  CornerNoise noise(kConfig, true);
  learn(noise, 0.001, 0.0);
  EXPECT_DOUBLE_EQ(noise.of(kAnyTag), 0.004) << "never below the errors of lens and print";
}

TEST(CornerNoise, UninformativeTagsAreIgnored) {
  CornerNoise noise(kConfig, true);
  for (int i = 0; i < kTags; ++i) {
    noise.learn(tag_at(i), 100.0, 0.0);
    noise.learn(tag_at(i), std::numeric_limits<double>::quiet_NaN(), 1.0);
  }
  EXPECT_EQ(noise.unexplained_px(), kConfig.corner_noise_px);
}

TEST(CornerNoise, AStaticTagIncreasesButDoesNotReduceTheNoise) {
  CornerNoise good(kConfig, true);
  CornerNoise bad(kConfig, true);
  for (int i = 0; i < kTags; ++i) {
    good.learn(tag_at(1, 0.3), 0.1, 1.0);
    bad.learn(tag_at(1), 50.0, 1.0);
  }
  EXPECT_NEAR(good.of(tag_at(1, 0.3)), 0.5, 1e-12);
  EXPECT_GT(bad.of(kAnyTag), 1.6);
}

TEST(CornerNoise, NoiseLearnedInMotionIsKeptAtRest) {
  CornerNoise noise(kConfig, true);
  learn(noise, 0.15, 0.0);
  const double in_motion = noise.of(kAnyTag);
  for (int i = 0; i < kTags; ++i) noise.learn(tag_at(kTags), 0.1, 1.0);
  // The first sighting after the last step may still count as moved: one step.
  EXPECT_NEAR(noise.of(kAnyTag) / in_motion, 1.0, 0.004);
}

/// As a detector here has measured it.
TagObservation measured(int k) {
  TagObservation seen = tag_at(k, 0.03);
  const double u = kWalks_px * k;
  seen.corners_px = {{{u, 40}, {u + 40, 40}, {u + 40, 0}, {u, 0}}};
  seen.raw_px = seen.corners_px;
  seen.sides.fill({0.02, 0.03});
  return seen;
}

/// Learned from some tags with distances all below, or all above the median.
double after_looks(bool falls_quickly, double distance) {
  CornerNoise noise(kConfig, true);
  noise.fall_quickly(falls_quickly);
  for (int i = 0; i < 60; ++i) noise.learn(measured(i), distance, 1.0);
  return noise.unexplained_px();
}

TEST(CornerNoise, FallsQuicklyWhenAllowedAndNeverRisesQuickly) {
  EXPECT_LT(after_looks(true, 0.1), 0.4 * after_looks(false, 0.1));
  EXPECT_DOUBLE_EQ(after_looks(true, 100.0), after_looks(false, 100.0));
}

TEST(CornerNoise, IsOneNumberWithoutMeasuredSides) {
  const CornerNoise noise(kConfig, true);
  EXPECT_TRUE(noise.is_uneven(measured(1))) << "equal sides, but shifted less than rotated";
  EXPECT_FALSE(noise.is_uneven(tag_at(1, 0.3)));
  EXPECT_FALSE(CornerNoise(kConfig, false).is_uneven(measured(1)));
}

TEST(CornerNoise, NineLooksAtOnePlaceAreWorthLessThanTwoUnlessTheNoiseIsWhite) {
  CornerNoise noise(kConfig, true);
  double information = 0;
  double first = 0;
  for (int look = 0; look < 9; ++look) {
    const double sigma_px = noise.of(measured(1));
    if (look == 0) first = sigma_px;
    information += first * first / (sigma_px * sigma_px);
    noise.learn(measured(1), 8.0, 0.0001);
  }
  EXPECT_LT(information, 2.0);
  EXPECT_GT(information, 1.4);
  EXPECT_NEAR(noise.of(measured(2)), first, 0.01 * first) << "a first look";
  EXPECT_NEAR(noise.covariance(measured(1), 0.0).trace(),
              64 * noise.covariance(measured(2), 0.0).trace(), 1.0);
  const double white = noise.of(tag_at(1));
  for (int look = 0; look < 9; ++look) noise.learn(tag_at(1), 8.0, 0.0001);
  EXPECT_NEAR(noise.of(tag_at(1)), white, 0.01 * white) << "other detectors' noise is white";
}

CameraMount lens_off_by(double error_px) {
  CameraMount mount;
  mount.model.width = 1000;
  mount.lens_error_px = error_px;
  return mount;
}

/// A tag of the image's middle, 40 px wide.
TagObservation square_at(double x) {
  TagObservation seen;
  seen.tag_id = 3;
  seen.raw_px = {{{x, 0}, {x + 40, 0}, {x + 40, 40}, {x, 40}}};
  seen.corners_px = seen.raw_px;
  return seen;
}

TEST(CornerNoise, ALensErrorCorrelatesTheCorners) {
  const CameraMount lens = lens_off_by(0.1);
  const CornerNoise noise(kConfig, true, &lens);
  const TagObservation seen = square_at(500);
  ASSERT_TRUE(noise.is_uneven(seen)) << "without a measured sigma, too";
  const Matrix8d R = noise.covariance(seen, 0);
  const double f = noise.unexplained_px();
  const double lens_variance = R(0, 0) - f * f;
  EXPECT_NEAR(noise.of(seen), std::sqrt(R(0, 0)), 1e-12);
  EXPECT_NEAR(std::sqrt(lens_variance), 0.2, 1e-9) << "twice the configured one";
  EXPECT_GT(R(0, 2), 0.9 * lens_variance) << "neighbouring corners";
  EXPECT_EQ(R(0, 1), 0) << "x and y are independent";
  EXPECT_GT(R.ldlt().vectorD().minCoeff(), 0);
  // With the exact sigma nothing changes.
  const CameraMount exact = lens_off_by(0);
  const CornerNoise plain(kConfig, true, &exact);
  EXPECT_FALSE(plain.is_uneven(seen));
  EXPECT_DOUBLE_EQ(plain.of(seen), CornerNoise(kConfig, true).of(seen));
}

/// The first eight looks at one part of the image are worth less than two, each later one a 64th:
/// tracking of a body at rest must not be lost.
TEST(CornerNoise, ALensErrorHardlyAveragesOutForAStaticTag) {
  const CameraMount lens = lens_off_by(0.1);
  CornerNoise noise(kConfig, true, &lens);
  noise.begin_with(1e-6);
  double information = 0;
  const double first = noise.of(square_at(500));
  for (int look = 0; look < 8; ++look) {
    const TagObservation seen = square_at(500 + 10 * look);  // within a fifth of 1000 px
    information += std::pow(first / noise.of(seen), 2);
    noise.learn(seen, 8.0, 1e-6);
  }
  EXPECT_LT(information, 2.0);
  EXPECT_GT(information, 1.4);
  for (int look = 0; look < 100; ++look) noise.learn(square_at(570), 8.0, 1e-6);
  EXPECT_NEAR(noise.of(square_at(570)) / first, 8, 0.01);
  EXPECT_NEAR(noise.of(square_at(800)), first, 1e-3 * first) << "another error";
}

TEST(CornerNoise, StartsWithTheNoiseLearnedByAnotherFilter) {
  CornerNoise noise(kConfig, true);
  noise.begin_with(0.05);
  EXPECT_DOUBLE_EQ(noise.of(kAnyTag), 0.05);
  EXPECT_DOUBLE_EQ(noise.growth(TagObservation{}), 1.0);
  noise.begin_with(3.0);
  EXPECT_DOUBLE_EQ(noise.of(kAnyTag), 0.4) << "at most the configured one";
}

TEST(CornerNoise, IsConstantWhenNothingIsLearned) {
  CornerNoise noise(kConfig, false);
  learn(noise, 2.0, 0.0);
  EXPECT_EQ(noise.of(tag_at(0, 0.3)), kConfig.corner_noise_px);
}

}  // namespace
}  // namespace fiducap

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
