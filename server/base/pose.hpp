#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace fiducap {

/// Where axes B stand in axes A: `X_AB`, read "pose of B in A". Adjacent letters cancel: X_AC =
/// X_AB * X_BC. Careful: Pose{{}, p} and Pose{q, {}} leave the empty part undefined (Eigen); write
/// Identity() and Zero().
struct Pose {
  Eigen::Quaterniond q{
      Eigen::Quaterniond::Identity()};  ///< q_AB: turns B-vectors into A-vectors. Hamilton, unit.
  Eigen::Vector3d p{
      Eigen::Vector3d::Zero()};  ///< p_AB: origin A → origin B, expressed in A, metres.

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

}  // namespace fiducap
