#include "estimation/filter/corner_noise.hpp"

#include <gtest/gtest.h>

#include <random>

namespace fiducap {
namespace {

constexpr int kTags = 4000;

/// Distances of tags whose corners scatter with `true_px`, as a filter sees them that is sure of
/// everything else.
void learn(CornerNoise& noise, double true_px, double outliers) {
  std::mt19937 random(5);
  std::chi_squared_distribution<double> distance(8);
  std::uniform_real_distribution<double> chance;
  for (int i = 0; i < kTags; ++i) {
    const double ratio = true_px / noise.of(TagObservation{});
    noise.learn(chance(random) < outliers ? 1e4 : distance(random) * ratio * ratio, 1.0);
  }
}

TEST(CornerNoise, FindsTheTrueScatterFromBothSides) {
  for (const double true_px : {0.15, 0.4, 1.6}) {
    CornerNoise noise(EstimatorConfig{}, true);
    learn(noise, true_px, 0.0);
    EXPECT_NEAR(noise.of(TagObservation{}) / true_px, 1.0, 0.06);
  }
}

TEST(CornerNoise, IsHardlyMovedByOutliers) {
  CornerNoise noise(EstimatorConfig{}, true);
  learn(noise, 0.4, 0.1);
  EXPECT_NEAR(noise.of(TagObservation{}) / 0.4, 1.0, 0.12);
}

TEST(CornerNoise, ADetectorsOwnShareComesOnTop) {
  CornerNoise noise(EstimatorConfig{}, true);
  TagObservation blurred;
  blurred.corner_sigma_px = 0.3;
  EXPECT_DOUBLE_EQ(noise.of(blurred), 0.5);
}

TEST(CornerNoise, WhatSaysNothingTeachesNothing) {
  CornerNoise noise(EstimatorConfig{}, true);
  for (int i = 0; i < kTags; ++i) {
    noise.learn(100.0, 0.0);
    noise.learn(std::numeric_limits<double>::quiet_NaN(), 1.0);
  }
  EXPECT_EQ(noise.unexplained_px(), EstimatorConfig{}.corner_noise_px);
}

TEST(CornerNoise, ThePapersFilterKeepsItsNumber) {
  CornerNoise noise(EstimatorConfig{}, false);
  TagObservation blurred;
  blurred.corner_sigma_px = 0.3;
  learn(noise, 2.0, 0.0);
  EXPECT_EQ(noise.of(blurred), EstimatorConfig{}.corner_noise_px);
}

}  // namespace
}  // namespace fiducap
