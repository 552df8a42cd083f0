#include <numbers>
#include <set>

#include <gmock/gmock.h>
#include <Eigen/LU>

#include "capture/imu_sample.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::Gt;
using testing::HasSubstr;
using testing::Lt;

ImuCorrection some_correction() {
  ImuCorrection c;
  c.accel_bias_m_s2 = {0.1, -0.2, 0.3};
  c.accel_matrix << 1.01, 0.002, -0.003, 0, 0.99, 0.004, 0, 0, 1.02;
  c.gyro_bias_rad_s = {0.01, 0.02, -0.03};
  c.gyro_matrix << 0.98, 0.01, 0.02, -0.01, 1.03, 0.04, 0.005, -0.006, 1.001;
  return c;
}

Expected<ImuCorrection> read_back(const std::string& yaml) {
  return read_imu_correction(TemporaryFolder().write("imu.yaml", yaml));
}

TEST(ImuCorrection, SubtractsTheBiasFirstAndKeepsTheStamp) {
  const ImuCorrection c = some_correction();
  const Eigen::Vector3d f(0.5, -9.6, 1.2);
  const Eigen::Vector3d w(0.3, -0.4, 2);
  ImuSample reading;
  reading.sampled_at = instant_from_ns(12345);
  reading.f_B = c.accel_matrix.inverse() * f + c.accel_bias_m_s2;
  reading.w_WB_B = c.gyro_matrix.inverse() * w + c.gyro_bias_rad_s;
  const ImuSample corrected = c.apply(reading);
  constexpr double kRounding = 1e-12;
  EXPECT_LT((corrected.f_B - f).norm(), kRounding);
  EXPECT_LT((corrected.w_WB_B - w).norm(), kRounding);
  EXPECT_EQ(corrected.sampled_at, reading.sampled_at);
}

TEST(ImuCorrection, ChangesNothingByDefault) {
  const ImuSample reading{instant_from_ns(1), {1, 2, 3}, {4, 5, 6}};
  const ImuSample same = ImuCorrection{}.apply(reading);
  EXPECT_EQ(same.f_B, reading.f_B);
  EXPECT_EQ(same.w_WB_B, reading.w_WB_B);
  EXPECT_TRUE(ImuCorrection{}.check("").empty());
}

TEST(ImuCorrection, IsReadAsItWasWritten) {
  const ImuCorrection c = some_correction();
  const ImuCorrection read = value_of(read_back(to_imu_correction_yaml(c, "a test")));
  EXPECT_EQ(read.accel_matrix, c.accel_matrix);
  EXPECT_EQ(read.accel_bias_m_s2, c.accel_bias_m_s2);
  EXPECT_EQ(read.gyro_matrix, c.gyro_matrix);
  EXPECT_EQ(read.gyro_bias_rad_s, c.gyro_bias_rad_s);
}

TEST(ImuCorrection, RefusesMissingAndImpossibleMatrices) {
  ImuCorrection c = some_correction();
  c.gyro_matrix *= 57.3;  // degrees
  EXPECT_EQ(c.check("x.").size(), 1U);
  EXPECT_THAT(error_of(read_back(to_imu_correction_yaml(c, "a test"))),
              HasSubstr("imu_correction.gyro_matrix"));
  EXPECT_THAT(error_of(read_back("imu_correction: {accel_bias_m_s2: [0, 0, 0]}\n")),
              HasSubstr("accel_matrix"));
}

constexpr double kDegree = std::numbers::pi / 180;

TEST(ImuPart, HasThreeTimesTheNoiseOfItsDataSheet) {
  const auto noise = noise_of_part("icm-42688-p", 500).value();
  EXPECT_NEAR(noise.gyro_noise_rad_s_rtHz, 3 * 0.0028 * kDegree, 1e-12);
  EXPECT_NEAR(noise.accel_noise_m_s2_rtHz, 3 * 70e-6 * 9.80665, 1e-12);
  EXPECT_EQ(noise.rate_hz, 500);
  EXPECT_NEAR(noise.gyro_range_rad_s, 2000 * kDegree, 1e-9);
  EXPECT_NEAR(noise.accel_range_m_s2, 16 * 9.80665, 1e-9);
}

TEST(ImuPart, HasEqualNoiseAndWalkAtAHundredSeconds) {
  const ImuNoise noise = *noise_of_part("bmi088", 200);
  EXPECT_NEAR(noise.gyro_noise_rad_s_rtHz / std::sqrt(100.0),
              noise.gyro_walk_rad_s2_rtHz * std::sqrt(100.0 / 3), 1e-12);
  EXPECT_NEAR(noise.accel_noise_m_s2_rtHz / std::sqrt(100.0),
              noise.accel_walk_m_s3_rtHz * std::sqrt(100.0 / 3), 1e-12);
}

TEST(ImuPart, IsFoundInAnySpellingAndAsAPartOfADevice) {
  for (const char* name : {"ICM-42688-P", "icm42688p", "ICM_42688", "icm-42688"})
    EXPECT_TRUE(noise_of_part(name, 200)) << name;
  EXPECT_FALSE(noise_of_part("icm", 200));
  EXPECT_FALSE(noise_of_part("", 200));
  EXPECT_EQ(noise_of_part("RealSense D435i", 200)->accel_noise_m_s2_rtHz,
            noise_of_part("bmi055", 200)->accel_noise_m_s2_rtHz);
  EXPECT_EQ(noise_of_part("oak-d-lite", 200)->gyro_noise_rad_s_rtHz,
            noise_of_part("bmi270", 200)->gyro_noise_rad_s_rtHz);
}

TEST(ImuPart, IsListedOnceWithPlausibleNoise) {
  std::set<std::string_view> names;
  for (const std::string_view name : part_names()) {
    SCOPED_TRACE(name);
    EXPECT_TRUE(names.insert(name).second);
    const auto noise = noise_of_part(name, 200).value();
    // From tactical to the cheapest: 3 × 2 … 20 mdps/√Hz, 3 × 50 … 500 µg/√Hz.
    EXPECT_THAT(noise.gyro_noise_rad_s_rtHz, AllOf(Gt(1e-4), Lt(1e-3)));
    EXPECT_THAT(noise.accel_noise_m_s2_rtHz, AllOf(Gt(1.5e-3), Lt(1.5e-2)));
  }
  EXPECT_GT(names.size(), 30u);
}

}  // namespace
}  // namespace fiducap
