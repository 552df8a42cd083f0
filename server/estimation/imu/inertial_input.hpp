#pragma once

#include <Eigen/Core>
#include <optional>

namespace fiducap {

/// The inertial reading that holds during one step, biases still in, and its noise.
struct InertialInput {
  Eigen::Vector3d w_B{Eigen::Vector3d::Zero()};  ///< rad/s
  Eigen::Vector3d f_B{Eigen::Vector3d::Zero()};  ///< m/s²
  /// False: no accelerometer. The body's acceleration is white noise of density `accel_noise`,
  /// gravity plays no part.
  bool has_accelerometer{true};
  /// Odometry in place of an accelerometer: the body goes that way, in the axes that it has when
  /// the step begins. Its turning is `w_B`; the noises are `gyro_noise` and `velocity_noise`.
  /// In segments alone: no filter takes it.
  std::optional<Eigen::Vector3d> v_B{};  ///< m/s
  double velocity_noise{};               ///< m/s/√Hz
  double gyro_noise{};                   ///< rad/s/√Hz
  double accel_noise{};                  ///< m/s²/√Hz
  double gyro_walk{};                    ///< rad/s²/√Hz
  double accel_walk{};                   ///< m/s³/√Hz
};

}  // namespace fiducap
