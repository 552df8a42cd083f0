#include "calibration/imu/imu_calibration.hpp"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <numbers>
#include <random>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "base/pose.hpp"
#include "capture/imu_sample.hpp"
#include "support/shared_data.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

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
  const auto found = calibrate_multi_pose(in_many_attitudes(truth, 36), kGravity, "test");
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_GE(found->rests, 34);
  constexpr double kSigmas = 4.5;  // of 18 numbers, the worst
  const ImuCorrection& c = found->correction;
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(c.accel_bias_m_s2(i), truth.accel_bias_m_s2(i),
                kSigmas * found->accel_bias_sigma_m_s2(i));
    EXPECT_NEAR(c.accel_matrix(i, i), truth.accel_matrix(i, i),
                kSigmas * found->accel_scale_sigma(i));
    EXPECT_NEAR(c.gyro_matrix(i, i), truth.gyro_matrix(i, i), kSigmas * found->gyro_scale_sigma(i));
  }
  constexpr double kMatrix = 2e-3, kGyroMatrix = 4e-3;
  EXPECT_LT((c.accel_matrix - truth.accel_matrix).cwiseAbs().maxCoeff(), kMatrix);
  EXPECT_LT((c.gyro_matrix - truth.gyro_matrix).cwiseAbs().maxCoeff(), kGyroMatrix);
  EXPECT_LT((c.gyro_bias_rad_s - truth.gyro_bias_rad_s).norm(), 1e-3);
  EXPECT_LT(found->gravity_rms_after, 0.01);
  EXPECT_GT(found->gravity_rms_before, 0.1);
  EXPECT_LT(found->up_rms_after, 0.3 * found->up_rms_before);
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
  const auto found = calibrate_multi_pose(samples, 9.81744, "xsens");
  ASSERT_TRUE(found) << found.error().text();
  const ImuCorrection& c = found->correction;
  // Of the same unit, by its maker: counts per m/s², counts per rad/s, and the zeros.
  const Eigen::Vector3d factory_accel(415, 413, 415), factory_gyro(4778, 4758, 4766);
  const Eigen::Vector3d factory_accel_zero(33123, 33276, 32360);
  const Eigen::Vector3d factory_gyro_zero(32768, 32466, 32485);
  const Eigen::Matrix3d accel = c.accel_matrix.inverse() * kAccelCounts;
  const Eigen::Matrix3d gyro = c.gyro_matrix.inverse() * kGyroCounts;
  std::cout << found->rests << " rests, " << found->turns << " turns\naccel counts\n"
            << accel << "\nzeros " << (c.accel_bias_m_s2 * kAccelCounts).transpose().array() + 32768
            << "\ngyro counts\n"
            << gyro << "\nzeros " << (c.gyro_bias_rad_s * kGyroCounts).transpose().array() + 32768
            << "\n|f| rms " << found->gravity_rms_before << " -> " << found->gravity_rms_after
            << " up rms deg " << found->up_rms_before * 57.29578 << " -> "
            << found->up_rms_after * 57.29578 << "\nsigmas " << found->accel_scale_sigma.transpose()
            << " " << found->accel_bias_sigma_m_s2.transpose() << " "
            << found->gyro_scale_sigma.transpose() << "\n";
  constexpr double kScale = 0.01;  // measured years later; the maker's parameters are rounded
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(accel.col(i).norm() / factory_accel(i), 1, kScale);
    EXPECT_NEAR(gyro.col(i).norm() / factory_gyro(i), 1, kScale);
    EXPECT_NEAR(c.accel_bias_m_s2(i) * kAccelCounts + 32768, factory_accel_zero(i), 40);
    EXPECT_NEAR(c.gyro_bias_rad_s(i) * kGyroCounts + 32768, factory_gyro_zero(i), 40);
  }
  EXPECT_GE(found->rests, 30);
  EXPECT_LT(found->gravity_rms_after, 0.01);
  EXPECT_LT(found->up_rms_after, 0.02);
}

}  // namespace
}  // namespace fiducap
