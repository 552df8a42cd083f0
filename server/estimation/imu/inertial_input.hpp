#pragma once

#include <Eigen/Core>

namespace fiducap {

/// The inertial reading that holds during one step, biases still in, and its noise.
struct InertialInput {
  Eigen::Vector3d w_B{Eigen::Vector3d::Zero()};  ///< rad/s
  Eigen::Vector3d f_B{Eigen::Vector3d::Zero()};  ///< m/s²
  /// False: no accelerometer. The body's acceleration is white noise of density `accel_noise`,
  /// gravity plays no part.
  bool has_accelerometer{true};
  double gyro_noise{};   ///< rad/s/√Hz
  double accel_noise{};  ///< m/s²/√Hz
  double gyro_walk{};    ///< rad/s²/√Hz
  double accel_walk{};   ///< m/s³/√Hz
};

}  // namespace fiducap
