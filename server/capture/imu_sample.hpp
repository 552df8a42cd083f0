#pragma once

#include <Eigen/Core>
#include <optional>

#include "base/time.hpp"
#include "capture/imu_correction.hpp"

namespace fiducap {

/// One reading of the inertial unit, in body axes B (= IMU axes), SI units. Biases still in.
struct ImuSample {
  Instant sampled_at{};
  Eigen::Vector3d w_WB_B{Eigen::Vector3d::Zero()};  ///< Angular rate of B against W, rad/s.
  Eigen::Vector3d f_B{
      Eigen::Vector3d::Zero()};  ///< Specific force, m/s²; at rest it points up with +9.81.
};

/// How noisy the unit is: continuous-time densities, 1-sigma, Kalibr's and EuRoC's meaning.
struct ImuNoise {
  double gyro_noise_rad_s_rtHz{2e-3};
  double gyro_walk_rad_s2_rtHz{2e-5};
  double accel_noise_m_s2_rtHz{2e-2};
  double accel_walk_m_s3_rtHz{5e-4};
  double rate_hz{200.0};
  double gyro_range_rad_s{0};  ///< Readings end here; 0: not known.
  double accel_range_m_s2{0};
  /// What is wrong with it for good, when that was calibrated. Samples come without it: where a
  /// reading ends is seen before it is corrected (ImuBuffer).
  std::optional<ImuCorrection> correction{};
};

}  // namespace fiducap
