#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/time.hpp"

namespace fiducap {

/// Pose of axes B in axes A: `X_AB`. Adjacent letters cancel: X_AC = X_AB * X_BC.
/// Pose{{}, p} and Pose{q, {}} leave the empty part undefined (Eigen); write Identity() and Zero().
struct Pose {
  /// q_AB: rotates B-vectors into A-vectors. Hamilton, unit.
  Eigen::Quaterniond q{Eigen::Quaterniond::Identity()};
  /// p_AB: origin A → origin B, expressed in A, metres.
  Eigen::Vector3d p{Eigen::Vector3d::Zero()};

  [[nodiscard]] Pose inverse() const { return {q.conjugate(), -(q.conjugate() * p)}; }
  [[nodiscard]] Eigen::Matrix3d rotation() const { return q.toRotationMatrix(); }
};

[[nodiscard]] inline Pose operator*(const Pose& X_AB, const Pose& X_BC) {
  return {(X_AB.q * X_BC.q).normalized(), X_AB.p + X_AB.q * X_BC.p};
}

/// The point given in B, expressed in A.
[[nodiscard]] inline Eigen::Vector3d operator*(const Pose& X_AB, const Eigen::Vector3d& p_B) {
  return X_AB.q * p_B + X_AB.p;
}

struct StampedPose {
  Instant at{};
  Pose X_WB;
};

/// skew(a) * b == a × b.
[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& a);

/// Unit quaternion of the rotation vector (axis × angle, rad). Exact at zero, any angle.
[[nodiscard]] Eigen::Quaterniond exp_so3(const Eigen::Vector3d& rotation_vector);

/// Rotation vector of a unit quaternion, angle in [0, π].
[[nodiscard]] Eigen::Vector3d log_so3(const Eigen::Quaterniond& q);

/// Left Jacobian: exp(φ + δ) ≈ exp(J_l(φ) δ) exp(φ). Barfoot, State Estimation, eq. 7.77.
[[nodiscard]] Eigen::Matrix3d left_jacobian_so3(const Eigen::Vector3d& rotation_vector);

/// Right Jacobian: exp(φ + δ) ≈ exp(φ) exp(J_r(φ) δ).
[[nodiscard]] inline Eigen::Matrix3d right_jacobian_so3(const Eigen::Vector3d& rotation_vector) {
  return left_jacobian_so3(-rotation_vector);
}

/// The shortest rotation that takes the direction of a to that of b.
[[nodiscard]] Eigen::Quaterniond rotation_between(const Eigen::Vector3d& a,
                                                  const Eigen::Vector3d& b);

/// Angle between two attitudes, rad, in [0, π].
[[nodiscard]] double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

}  // namespace fiducap
