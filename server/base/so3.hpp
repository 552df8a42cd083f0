#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace fiducap {

/// skew(a) * b == a × b.
[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& a);

/// Unit quaternion of the rotation vector (axis × angle, rad). Exact at zero, any angle.
[[nodiscard]] Eigen::Quaterniond exp_so3(const Eigen::Vector3d& rotation_vector);

/// Rotation vector of a unit quaternion, angle in [0, π].
[[nodiscard]] Eigen::Vector3d log_so3(const Eigen::Quaterniond& q);

/// Left Jacobian: exp(φ + δ) ≈ exp(J_l(φ) δ) exp(φ). Barfoot, State Estimation for Robotics,
/// eq. 7.77.
[[nodiscard]] Eigen::Matrix3d left_jacobian_so3(const Eigen::Vector3d& rotation_vector);

/// Right Jacobian: exp(φ + δ) ≈ exp(φ) exp(J_r(φ) δ).
[[nodiscard]] inline Eigen::Matrix3d right_jacobian_so3(const Eigen::Vector3d& rotation_vector) {
  return left_jacobian_so3(-rotation_vector);
}

/// Angle between two attitudes, rad, in [0, π].
[[nodiscard]] double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

}  // namespace fiducap
