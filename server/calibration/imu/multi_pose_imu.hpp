#pragma once

#include <span>
#include <string>

#include "base/expected.hpp"
#include "capture/imu_correction.hpp"

namespace fiducap {

/// What many attitudes at rest say about an IMU.
struct MultiPoseImu {
  ImuCorrection correction;
  Eigen::Vector3d accel_bias_sigma_m_s2{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_scale_sigma{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gyro_scale_sigma{Eigen::Vector3d::Zero()};
  int rests{};
  int turns{};  ///< Between rests, by more than 5°: what the gyro is judged by.
  double seconds{};
  /// | |f| − g | over the rests, root mean square, m/s²; as read and corrected.
  double gravity_rms_before{};
  double gravity_rms_after{};
  /// Up as the gyro carries it from one rest to the next against up at the next, root mean square,
  /// rad; as read (bias taken out) and corrected.
  double up_rms_before{};
  double up_rms_after{};
};

/// Bias, scale and misalignment of an IMU that was put down in many attitudes. Rests are found by
/// the scatter of the accelerometer; what scatter is still at rest is chosen so that the
/// accelerometer fits best. Body axes are the accelerometer's: z along its z, x in its xz plane.
/// Method: D. Tedaldi, A. Pretto, E. Menegatti, "A robust and easy to implement method for IMU
/// calibration without external equipments", ICRA 2014; here with the gyro's bias from the rests
/// before and after each turn.
/// @return Error that says what is missing
[[nodiscard]] Expected<MultiPoseImu> calibrate_multi_pose(std::span<const ImuSample> samples,
                                                          double gravity_m_s2,
                                                          const std::string& context);

}  // namespace fiducap
