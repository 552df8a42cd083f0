#include "calibration/imu/imu_calibration.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <numbers>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/LU>

#include "base/pose.hpp"
#include "base/yaml_section.hpp"
#include "capture/imu_sample.hpp"
#include "support/results.hpp"
#include "support/shared_data.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

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

TEST(AllanDeviation, OfAlternatingValuesIsKnownExactlyAndNeedsEighteen) {
  // +1 −1 +1 …: at one sample (2)²/2, so σ = √2; averages of two are all zero.
  std::vector<double> values;
  for (int i = 0; i < 100; ++i) values.push_back(i % 2 == 0 ? 1 : -1);
  const auto plot = allan_deviation(values, 10);
  ASSERT_GE(plot.size(), 2U);
  EXPECT_DOUBLE_EQ(plot[0].tau_s, 0.1);
  EXPECT_NEAR(plot[0].deviation, std::sqrt(2.0), 1e-12);
  EXPECT_DOUBLE_EQ(plot[1].tau_s, 0.2);
  EXPECT_NEAR(plot[1].deviation, 0, 1e-12);
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
  const auto theirs = value_of(YamlSection::load(folder / (name + "_imu_param.yaml")));
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
          theirs.section(gyro ? "Gyr" : "Acc").section(std::string(1, axis) + "-axis");
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

constexpr double kGravity = 9.81;
constexpr double kRate_hz = 100;

/// Readings are matrix⁻¹ · truth + bias.
ImuCorrection wrong_unit() {
  ImuCorrection c;
  c.accel_bias_m_s2 = {0.12, -0.2, 0.07};
  c.accel_matrix << 1.012, 0.004, -0.006, 0, 0.991, 0.003, 0, 0, 1.006;
  c.gyro_bias_rad_s = {0.01, -0.02, 0.015};
  c.gyro_matrix << 0.985, 0.012, -0.008, 0.006, 1.02, 0.01, -0.004, 0.003, 1.008;
  return c;
}

class Hand final {
 public:
  explicit Hand(const ImuCorrection& unit)
      : accel_(unit.accel_matrix.inverse()), gyro_(unit.gyro_matrix.inverse()), unit_(unit) {}

  void rest(double seconds) {
    for (int i = 0; i < seconds * kRate_hz; ++i) add(Eigen::Vector3d::Zero(), 0);
  }
  /// Turned about an axis of the body, slow at both ends; a hand shakes.
  void turn(const Eigen::Vector3d& by_rad, double seconds) {
    const int steps = static_cast<int>(seconds * kRate_hz);
    for (int i = 0; i < steps; ++i) {
      const double phase = 2 * std::numbers::pi * (i + 0.5) / steps;
      add(by_rad / seconds * (1 - std::cos(phase)), 0.6);
    }
  }
  std::vector<ImuSample> samples;

 private:
  Eigen::Vector3d any(double sigma) {
    std::normal_distribution<double> normal(0, sigma);
    Eigen::Vector3d out;
    for (int i = 0; i < 3; ++i) out(i) = normal(random_);
    return out;
  }
  void add(const Eigen::Vector3d& w, double shaking) {
    constexpr double kAccelNoise = 0.02, kGyroNoise = 0.004;
    // The reading is that of the middle of the step.
    const Eigen::Quaterniond q = q_WB_ * exp_so3(w / kRate_hz / 2);
    const Eigen::Vector3d f = q.conjugate() * Eigen::Vector3d(0, 0, kGravity) + any(shaking);
    samples.push_back({instant_from_ns(1'000'000'000LL + 10'000'000LL * count_++),
                       gyro_ * w + unit_.gyro_bias_rad_s + any(kGyroNoise),
                       accel_ * f + unit_.accel_bias_m_s2 + any(kAccelNoise)});
    q_WB_ = (q_WB_ * exp_so3(w / kRate_hz)).normalized();
  }

  Eigen::Matrix3d accel_, gyro_;
  ImuCorrection unit_;
  Eigen::Quaterniond q_WB_{Eigen::Quaterniond::Identity()};
  std::mt19937_64 random_{5};
  std::int64_t count_{0};
};

std::vector<ImuSample> in_many_attitudes(const ImuCorrection& unit, int attitudes,
                                         bool about_all_axes = true) {
  Hand hand(unit);
  hand.rest(10);
  for (int i = 0; i < attitudes; ++i) {
    const double angle = 0.6 + 0.25 * (i % 5);
    Eigen::Vector3d axis(std::sin(1.7 * i), std::cos(2.9 * i), std::sin(0.8 * i + 1));
    if (!about_all_axes) axis = {0.05 * std::sin(i), 0, 1};
    hand.turn(angle * axis.normalized(), 1.5);
    hand.rest(2.5);
  }
  return hand.samples;
}

TEST(MultiPoseImu, FindsBiasScaleAndMisalignmentWithinTheirSigma) {
  const ImuCorrection truth = wrong_unit();
  const auto found = value_of(calibrate_multi_pose(in_many_attitudes(truth, 36), kGravity, "test"));
  EXPECT_GE(found.rests, 34);
  constexpr double kSigmas = 4.5;  // of 18 numbers, the worst
  const ImuCorrection& c = found.correction;
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(c.accel_bias_m_s2(i), truth.accel_bias_m_s2(i),
                kSigmas * found.accel_bias_sigma_m_s2(i));
    EXPECT_NEAR(c.accel_matrix(i, i), truth.accel_matrix(i, i),
                kSigmas * found.accel_scale_sigma(i));
    EXPECT_NEAR(c.gyro_matrix(i, i), truth.gyro_matrix(i, i), kSigmas * found.gyro_scale_sigma(i));
  }
  constexpr double kMatrix = 2e-3, kGyroMatrix = 4e-3;
  EXPECT_LT((c.accel_matrix - truth.accel_matrix).cwiseAbs().maxCoeff(), kMatrix);
  EXPECT_LT((c.gyro_matrix - truth.gyro_matrix).cwiseAbs().maxCoeff(), kGyroMatrix);
  EXPECT_LT((c.gyro_bias_rad_s - truth.gyro_bias_rad_s).norm(), 1e-3);
  EXPECT_LT(found.gravity_rms_after, 0.01);
  EXPECT_GT(found.gravity_rms_before, 0.1);
  EXPECT_LT(found.up_rms_after, 0.3 * found.up_rms_before);
}

TEST(MultiPoseImu, RefusesTooFewOrSimilarAttitudes) {
  struct Case {
    std::vector<ImuSample> samples;
    const char* text;
  };
  for (const auto& [samples, text] :
       {Case{in_many_attitudes(wrong_unit(), 6), "at rest in 7 places, at least 12 are needed"},
        {in_many_attitudes(wrong_unit(), 30, false), "too similar"},
        {{}, ""}}) {
    const auto found = calibrate_multi_pose(samples, kGravity, "test");
    ASSERT_FALSE(found);
    EXPECT_THAT(found.error().text(), HasSubstr(text));
  }
}

/// The Xsens recording of imu_tk: raw counts, here divided by round numbers.
std::vector<ImuSample> read_xsens(const std::filesystem::path& folder, double accel_counts,
                                  double gyro_counts) {
  const auto unpacked = [&](const char* name) {
    const std::string command = "gzip -dc '" + (folder / name).string() + "'";
    std::stringstream text;
    if (FILE* pipe = ::popen(command.c_str(), "r")) {
      std::array<char, 65536> block{};
      while (const std::size_t count = std::fread(block.data(), 1, block.size(), pipe))
        text.write(block.data(), static_cast<std::streamsize>(count));
      ::pclose(pipe);
    }
    return text;
  };
  std::stringstream accel = unpacked("xsens_acc.mat.gz");
  std::stringstream gyro = unpacked("xsens_gyro.mat.gz");
  constexpr double kMiddle = 32768;
  std::vector<ImuSample> samples;
  double t_s = 0, also_s = 0;
  Eigen::Vector3d f, w;
  while (accel >> t_s >> f.x() >> f.y() >> f.z() && gyro >> also_s >> w.x() >> w.y() >> w.z())
    samples.push_back({instant_from_ns(static_cast<std::int64_t>(t_s * 1e9)),
                       (w.array() - kMiddle) / gyro_counts, (f.array() - kMiddle) / accel_counts});
  return samples;
}

TEST(MultiPoseImuData, TheXsensRecordingGivesTheFactorysParameters) {
  const auto data = shared_data();
  if (!data) GTEST_SKIP() << kNoSharedData;
  constexpr double kAccelCounts = 400, kGyroCounts = 5000;
  const auto samples =
      read_xsens(*data / "imu/imu_tk_xsens/bin/test_data", kAccelCounts, kGyroCounts);
  ASSERT_EQ(samples.size(), 51175U);
  const auto found = value_of(calibrate_multi_pose(samples, 9.81744, "xsens"));
  const ImuCorrection& c = found.correction;
  // Of the same unit, by its maker: counts per m/s², counts per rad/s, and the zeros.
  const Eigen::Vector3d factory_accel(415, 413, 415), factory_gyro(4778, 4758, 4766);
  const Eigen::Vector3d factory_accel_zero(33123, 33276, 32360);
  const Eigen::Vector3d factory_gyro_zero(32768, 32466, 32485);
  const Eigen::Matrix3d accel = c.accel_matrix.inverse() * kAccelCounts;
  const Eigen::Matrix3d gyro = c.gyro_matrix.inverse() * kGyroCounts;
  constexpr double kScale = 0.01;  // measured years later; the maker's parameters are rounded
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(accel.col(i).norm() / factory_accel(i), 1, kScale);
    EXPECT_NEAR(gyro.col(i).norm() / factory_gyro(i), 1, kScale);
    EXPECT_NEAR(c.accel_bias_m_s2(i) * kAccelCounts + 32768, factory_accel_zero(i), 40);
    EXPECT_NEAR(c.gyro_bias_rad_s(i) * kGyroCounts + 32768, factory_gyro_zero(i), 40);
  }
  EXPECT_GE(found.rests, 30);
  EXPECT_LT(found.gravity_rms_after, 0.01);
  EXPECT_LT(found.up_rms_after, 0.02);
}

}  // namespace
}  // namespace fiducap
