#include "calibration/imu/imu_calibration.hpp"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace fiducap {
namespace {

struct Density {
  double white{};
  double walk{};
};

std::vector<double> noise(const Density& density, std::size_t samples, double rate_hz,
                          unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> values;
  double bias = 0.3;  // a constant must not matter
  for (std::size_t i = 0; i < samples; ++i) {
    values.push_back(bias + density.white * std::sqrt(rate_hz) * normal(random));
    bias += density.walk / std::sqrt(rate_hz) * normal(random);
  }
  return values;
}

AxisNoise identified(const Density& density, std::size_t samples, double rate_hz, unsigned seed) {
  return fit_noise(allan_deviation(noise(density, samples, rate_hz, seed), rate_hz));
}

TEST(AllanDeviation, OfAlternatingValuesIsKnownExactly) {
  // +1 −1 +1 …: at one sample (2)²/2, so σ = √2; averages of two are all zero.
  std::vector<double> values;
  for (int i = 0; i < 100; ++i) values.push_back(i % 2 == 0 ? 1 : -1);
  const auto plot = allan_deviation(values, 10);
  ASSERT_GE(plot.size(), 2U);
  EXPECT_DOUBLE_EQ(plot[0].tau_s, 0.1);
  EXPECT_NEAR(plot[0].deviation, std::sqrt(2.0), 1e-12);
  EXPECT_DOUBLE_EQ(plot[1].tau_s, 0.2);
  EXPECT_NEAR(plot[1].deviation, 0, 1e-12);
}

TEST(AllanDeviation, NeedsEighteenValues) {
  EXPECT_TRUE(allan_deviation(std::vector<double>(17, 1.0), 100).empty());
  EXPECT_FALSE(allan_deviation(std::vector<double>(18, 1.0), 100).empty());
}

TEST(AllanDeviation, WhiteNoiseIsFoundAsWellAsItsSamplesAllow) {
  constexpr std::size_t kSamples = 120'000;
  // σ²(one sample) alone has 2n/3 degrees of freedom: a relative sigma of √(3/4n) in σ. Four of
  // them.
  const double tolerance = 4 * std::sqrt(3.0 / (4.0 * kSamples));
  for (unsigned seed = 1; seed <= 10; ++seed)
    EXPECT_NEAR(identified({2e-3, 0}, kSamples, 200, seed).white / 2e-3, 1, tolerance)
        << "seed " << seed;
}

TEST(AllanDeviation, BiasWalkIsFoundWithinItsOwnSigma) {
  constexpr Density kTrue{1e-2, 1e-3};
  double squares = 0;
  constexpr int kSeeds = 40;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const AxisNoise found = identified(kTrue, 72'000, 20, seed);
    ASSERT_TRUE(found.walk_seen) << "seed " << seed;
    const double off = (found.walk - kTrue.walk) / found.walk_sigma;
    squares += off * off / kSeeds;
    EXPECT_LT(found.walk_sigma, 0.3 * kTrue.walk) << "seed " << seed;
  }
  // Mean of 40 squared normals: 1 ± 0.22; neighbouring points share data, so the sigma is a guide
  // (factor 1.5).
  EXPECT_LT(squares, 1.5 * 1.5 * (1 + 3 * 0.22));
  EXPECT_GT(squares, (1 - 3 * 0.22) / (1.5 * 1.5));
}

TEST(AllanDeviation, AWalkTooSmallForTheRecordingIsBounded) {
  constexpr Density kTrue{1e-2, 1e-4};
  int claimed = 0;
  int above = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const AxisNoise found = identified(kTrue, 2'000, 20, seed);  // 100 s; 15 000 s are needed
    claimed += found.walk_seen ? 1 : 0;
    above += kTrue.walk > found.walk_bound ? 1 : 0;
    EXPECT_GT(found.seconds_to_see(kTrue.walk), 10000) << "seed " << seed;
  }
  EXPECT_LE(claimed, 2);  // of 40, at three sigma
  EXPECT_LE(above, 6);    // of 40, at 95 %: 2 ± 1.4, three sigma
}

TEST(AllanDeviation, ARecordingOfTheRequiredDurationShowsTheWalk) {
  constexpr Density kTrue{1e-2, 1e-3};
  const double seconds = identified(kTrue, 20'000, 20, 99).seconds_to_see(kTrue.walk);
  int seen = 0;
  for (unsigned seed = 1; seed <= 60; ++seed)
    seen += identified(kTrue, static_cast<std::size_t>(seconds * 20), 20, seed).walk_seen ? 1 : 0;
  EXPECT_GE(seen, 52);  // of 60, at 95 %: 57 ± 1.7, three sigma
}

}  // namespace
}  // namespace fiducap
