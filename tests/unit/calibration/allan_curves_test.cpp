// Allan curves of real IMUs, two hours at rest, with the results of another program (imu_utils).
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/yaml_section.hpp"
#include "calibration/imu/imu_calibration.hpp"
#include "support/shared_data.hpp"

namespace fiducap {
namespace {

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
