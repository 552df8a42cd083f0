#include "calibration/imu/imu_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/yaml_section.hpp"
#include "support/shared_data.hpp"

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

TEST(AllanDeviation, FindsWhiteNoiseWithinItsSigma) {
  constexpr std::size_t kSamples = 120'000;
  // σ²(one sample) alone has 2n/3 degrees of freedom: four relative sigmas of √(3/4n) in σ.
  const double tolerance = 4 * std::sqrt(3.0 / (4.0 * kSamples));
  for (unsigned seed = 1; seed <= 10; ++seed)
    EXPECT_NEAR(identified({2e-3, 0}, kSamples, 200, seed).white / 2e-3, 1, tolerance)
        << "seed " << seed;
}

TEST(AllanDeviation, FindsABiasWalkWithinItsSigma) {
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

// Allan curves of real IMUs, two hours at rest, with the results of another program (imu_utils).
std::vector<double> numbers_of_file(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<double> values;
  for (double value = 0; file >> value;) values.push_back(value);
  return values;
}

/// Their curves end at a third of the recording.
std::vector<AllanPoint> curve_of(const std::vector<double>& tau_s,
                                 const std::vector<double>& deviation, double unit) {
  std::vector<AllanPoint> points;
  const double seconds = 3 * tau_s.back();
  for (std::size_t i = 0; i < std::min(tau_s.size(), deviation.size()); ++i)
    points.push_back(
        {tau_s[i], deviation[i] * unit, std::max(1.0, 1.5 * (seconds / tau_s[i] - 2))});
  return points;
}

class AllanCurves : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(ImuUtils, AllanCurves, ::testing::Values("16448", "A3", "N3", "BMI160"));

TEST_P(AllanCurves, AgreeWithAnotherProgram) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  const std::string name = GetParam();
  const std::filesystem::path folder = *data / "imu/allan_imu_utils/data";
  const auto theirs = YamlSection::load(folder / (name + "_imu_param.yaml"));
  ASSERT_TRUE(theirs) << theirs.error().text();
  constexpr double kDegreePerHour = std::numbers::pi / 180 / 3600;
  for (const bool gyro : {true, false})
    for (const char axis : {'x', 'y', 'z'}) {
      const std::string stem = "data_" + name + (gyro ? "_gyr_" : "_acc_");
      const auto points =
          curve_of(numbers_of_file(folder / (stem + "t.txt")),
                   numbers_of_file(folder / (stem + axis + ".txt")), gyro ? kDegreePerHour : 1);
      ASSERT_GE(points.size(), 50U) << stem << axis;
      const AxisNoise ours = fit_noise(points);
      const YamlSection their_axis =
          theirs->section(gyro ? "Gyr" : "Acc").section(std::string(1, axis) + "-axis");
      // The file of the BMI160 has the spread of samples, at 200 Hz; the others a density.
      const double per_density = name == "BMI160" ? std::sqrt(200.0) : 1;
      const double white = their_axis.required_number(gyro ? "gyr_n" : "acc_n") / per_density;
      const double flat = their_axis.required_number(gyro ? "gyr_w" : "acc_w");
      double lowest = points.front().deviation;
      for (const AllanPoint& p : points) lowest = std::min(lowest, ours.deviation(p.tau_s));
      std::cout << "| " << name << (gyro ? " gyro " : " accel ") << axis << " | " << white << " | "
                << ours.white << " ± " << ours.white_sigma << " | " << ours.deviation(1) << " | "
                << flat << " | " << lowest << " | " << (ours.walk_seen ? ours.walk : 0.0) << " |\n";
      // imu_utils uses single points of the curve, at 1 s and at its minimum; ours is the smooth
      // curve of three parts, which fits real sensors to this accuracy.
      constexpr double kPoint = 0.3;
      EXPECT_NEAR(ours.deviation(1) / white, 1, kPoint) << stem << axis;
      EXPECT_NEAR(lowest / flat, 1, kPoint) << stem << axis;
    }
}

}  // namespace
}  // namespace fiducap
