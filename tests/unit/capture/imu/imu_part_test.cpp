#include "capture/imu/imu_part.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <set>

namespace fiducap {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

TEST(ImuPart, AKnownPartHasThreeTimesTheNoiseOfItsDataSheet) {
  const auto noise = noise_of_part("icm-42688-p", 500);
  ASSERT_TRUE(noise);
  EXPECT_NEAR(noise->gyro_noise_rad_s_rtHz, 3 * 0.0028 * kDegree, 1e-12);
  EXPECT_NEAR(noise->accel_noise_m_s2_rtHz, 3 * 70e-6 * 9.80665, 1e-12);
  EXPECT_EQ(noise->rate_hz, 500);
  EXPECT_NEAR(noise->gyro_range_rad_s, 2000 * kDegree, 1e-9);
  EXPECT_NEAR(noise->accel_range_m_s2, 16 * 9.80665, 1e-9);
}

TEST(ImuPart, WhiteNoiseAndWalkMeetAtAHundredSeconds) {
  const ImuNoise noise = *noise_of_part("bmi088", 200);
  EXPECT_NEAR(noise.gyro_noise_rad_s_rtHz / std::sqrt(100.0),
              noise.gyro_walk_rad_s2_rtHz * std::sqrt(100.0 / 3), 1e-12);
  EXPECT_NEAR(noise.accel_noise_m_s2_rtHz / std::sqrt(100.0),
              noise.accel_walk_m_s3_rtHz * std::sqrt(100.0 / 3), 1e-12);
}

TEST(ImuPart, NamesAreFoundHoweverTheyAreWritten) {
  for (const char* name : {"ICM-42688-P", "icm42688p", "ICM_42688", "icm-42688"})
    EXPECT_TRUE(noise_of_part(name, 200)) << name;
  EXPECT_FALSE(noise_of_part("icm", 200));
  EXPECT_FALSE(noise_of_part("", 200));
}

TEST(ImuPart, CamerasAndAutopilotsHaveThoseOfTheirChip) {
  EXPECT_EQ(noise_of_part("RealSense D435i", 200)->accel_noise_m_s2_rtHz,
            noise_of_part("bmi055", 200)->accel_noise_m_s2_rtHz);
  EXPECT_EQ(noise_of_part("oak-d-lite", 200)->gyro_noise_rad_s_rtHz,
            noise_of_part("bmi270", 200)->gyro_noise_rad_s_rtHz);
}

TEST(ImuPart, EveryNameOfTheListIsFoundAndIsThereOnce) {
  std::set<std::string_view> names;
  for (const std::string_view name : part_names()) {
    EXPECT_TRUE(names.insert(name).second) << name;
    const auto noise = noise_of_part(name, 200);
    ASSERT_TRUE(noise) << name;
    // From tactical to the cheapest: 3 × 2 … 20 mdps/√Hz, 3 × 50 … 500 µg/√Hz.
    EXPECT_GT(noise->gyro_noise_rad_s_rtHz, 1e-4) << name;
    EXPECT_LT(noise->gyro_noise_rad_s_rtHz, 1e-3) << name;
    EXPECT_GT(noise->accel_noise_m_s2_rtHz, 1.5e-3) << name;
    EXPECT_LT(noise->accel_noise_m_s2_rtHz, 1.5e-2) << name;
  }
  EXPECT_GT(names.size(), 30u);
}

}  // namespace
}  // namespace fiducap
