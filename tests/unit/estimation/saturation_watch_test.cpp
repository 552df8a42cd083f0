#include "estimation/imu/imu_buffer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace fiducap {
namespace {

/// A body that turns and shakes, read by a unit with this resolution and range.
class Unit {
 public:
  Unit(double resolution, double noise) : resolution_(resolution), noise_(noise) {}

  ImuSample read(double motion, double range) {
    const double t = 0.005 * static_cast<double>(k_++);
    ImuSample imu;
    for (int i = 0; i < 3; ++i) {
      imu.w_WB_B(i) = reading(motion * std::sin(3 * t + i), range);
      imu.f_B(i) = reading(motion * std::cos(2 * t + i) + (i == 2 ? 9.81 : 0.0), 100.0);
    }
    return imu;
  }

 private:
  double reading(double value, double range) {
    value = std::clamp(value + noise_ * gauss_(random_), -range, range);
    return resolution_ > 0 ? resolution_ * std::round(value / resolution_) : value;
  }

  double resolution_;
  double noise_;
  long k_{0};
  std::mt19937 random_{3};
  std::normal_distribution<double> gauss_;
};

constexpr int kReadings = 4000;

TEST(SaturationWatch, AnUnsaturatedSensorIsNotReported) {
  struct Case {
    const char* what;
    double resolution, noise, motion, motion_afterwards;
    int most;  ///< Reports.
  };
  for (const auto& [what, resolution, noise, motion, motion_afterwards, most] :
       {Case{"a fine one in motion", 0, 0.01, 1, 1, 0},
        {"a coarse one at rest, noise of half its resolution", 0.001, 0.0005, 0, 0, 2},
        {"of its resolution", 0.001, 0.001, 0, 0, 2},
        {"of three times its resolution", 0.001, 0.003, 0, 0, 2},
        {"without noise, then at rest", 0, 0, 1, 0, 0}}) {
    SaturationWatch watch{ImuNoise{}};
    Unit unit(resolution, noise);
    int reported = 0;
    for (int k = 0; k < kReadings; ++k) {
      const auto found =
          watch.look_at(unit.read(k < kReadings / 2 ? motion : motion_afterwards, 10));
      reported += found.now.gyro || found.now.accel ? 1 : 0;
    }
    EXPECT_LE(reported, most) << what;
  }
}

TEST(SaturationWatch, AFlatTopIsFoundWithAllItsReadings) {
  for (const double resolution : {0.0, 0.001}) {
    SaturationWatch watch{ImuNoise{}};
    Unit unit(resolution, 0.003);
    for (int k = 0; k < 400; ++k) (void)watch.look_at(unit.read(1.0, 10));
    int cut = 0;
    int missed = 0;
    std::size_t before = 0;
    for (int k = 0; k < 400; ++k) {
      const ImuSample imu = unit.read(1.0, 0.5);
      const bool at_end = imu.w_WB_B.cwiseAbs().maxCoeff() >= 0.5;
      const auto found = watch.look_at(imu);
      cut += at_end ? 1 : 0;
      missed += at_end && !found.now.gyro ? 1 : 0;
      before += found.gyro_since;
      EXPECT_FALSE(found.now.accel);
    }
    EXPECT_GT(cut, 200);
    // Late detections are reported afterwards; only peaks of a few readings stay undetected.
    EXPECT_LT(missed - static_cast<int>(before), 0.08 * cut) << resolution;
  }
}

TEST(SaturationWatch, AKnownRangeIsFoundAtOnce) {
  ImuNoise noise;
  noise.gyro_range_rad_s = 0.5;
  SaturationWatch watch{noise};
  ImuSample imu;
  imu.w_WB_B = {0.1, -0.5, 0.2};
  EXPECT_TRUE(watch.look_at(imu).now.gyro);
  imu.w_WB_B = {0.1, -0.49, 0.2};
  EXPECT_FALSE(watch.look_at(imu).now.gyro);
}

}  // namespace
}  // namespace fiducap
