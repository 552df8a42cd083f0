#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

#include "base/pose.hpp"
#include "estimation/known_tag.hpp"

/// Errors of poses are on the world's side: X = Exp(ξ) X̂, ξ = (ρ, φ).
namespace fiducap::world {

/// First row of each error block in the covariance. Blocks are three wide, in W axes except for
/// biases and clocks.
///
/// For a pose X = Exp(ξ) X̂: q = exp(φ) q̂, p = exp(φ) p̂ + J_l(φ) ρ; for the velocity v = exp(φ) v̂ +
/// J_l(φ) ν (right-invariant error: Barrau & Bonnabel, arXiv 1510.06263; Hartley et al., IJRR 2020;
/// each tag has its own rotation, the decoupled form). A motion of the whole workspace is the same
/// ξ for the body and all tags at any estimate, so images give no information about it.
namespace layout {
inline constexpr int kPosition = 0;  ///< ρ of the body, m.
inline constexpr int kAttitude = 3;  ///< φ of the body, rad.
inline constexpr int kVelocity = 6;  ///< ν, m/s.
inline constexpr int kBiasF = 9;     ///< accelerometer bias, B axes, m/s².
inline constexpr int kBiasW = 12;    ///< gyro bias, B axes, rad/s.
inline constexpr int kBodySize = 15;

inline constexpr int kPoseSize = 6;
inline constexpr int kCameraSize = kPoseSize + 6;
/// Camera c: ρ, φ of X_WV.
[[nodiscard]] constexpr int camera(int camera) { return kBodySize + kCameraSize * camera; }
/// Clock of camera c: time shift, s; readout, s; then the relative focal length.
[[nodiscard]] constexpr int clock(int camera) { return layout::camera(camera) + kPoseSize; }
/// Calibration parameters of camera c, in sequence: readout, s; focal length, relative; principal
/// point u, v, px; first distortion coefficient.
[[nodiscard]] constexpr int readout(int camera) { return clock(camera) + 1; }
[[nodiscard]] constexpr int focal(int camera) { return clock(camera) + 2; }
[[nodiscard]] constexpr int centre(int camera) { return clock(camera) + 3; }
[[nodiscard]] constexpr int distortion(int camera) { return clock(camera) + 5; }
/// Relative tag sizes: common to all, then of the watched tags.
inline constexpr int kWatchedPrints = 5;
[[nodiscard]] constexpr int sizes(int cameras) { return kBodySize + kCameraSize * cameras; }
[[nodiscard]] constexpr int print(int cameras, int watched) { return sizes(cameras) + 1 + watched; }
/// Parameters of the motion, in sequence: gravity minus the configured value, m/s²; the errors of
/// the IMU (ImuIntrinsics): accelerometer scale, rotation, scale and drift of the gyroscope, three
/// each.
inline constexpr int kMotionSize = 13;
[[nodiscard]] constexpr int gravity(int cameras) { return sizes(cameras) + 1 + kWatchedPrints; }
[[nodiscard]] constexpr int accel_scale(int cameras) { return gravity(cameras) + 1; }
[[nodiscard]] constexpr int gyro_turn(int cameras) { return gravity(cameras) + 4; }
[[nodiscard]] constexpr int gyro_scale(int cameras) { return gravity(cameras) + 7; }
[[nodiscard]] constexpr int gyro_drift(int cameras) { return gravity(cameras) + 10; }
/// Tag i: ρ, φ.
[[nodiscard]] constexpr int tag(int cameras, int i) {
  return gravity(cameras) + kMotionSize + kPoseSize * i;
}
}  // namespace layout

using BodyMatrix = Eigen::Matrix<double, layout::kBodySize, layout::kBodySize>;

/// Exp(ξ) X, by the exponential of SE(3): a rotation about a tag's centre keeps the centre, for any
/// distance from the origin and any angle.
[[nodiscard]] inline Pose moved(const Pose& X, const Eigen::Ref<const Eigen::VectorXd>& error) {
  const Eigen::Vector3d phi = error.tail<3>();
  const Eigen::Quaterniond turn = exp_so3(phi);
  return {(turn * X.q).normalized(), turn * X.p + left_jacobian_so3(phi) * error.head<3>()};
}

/// The world-side error ξ between two poses: to = Exp(ξ) from.
[[nodiscard]] inline Vector6d world_error_between(const Pose& from, const Pose& to) {
  const Eigen::Quaterniond turn = to.q * from.q.conjugate();
  Vector6d error;
  error.tail<3>() = log_so3(turn);
  error.head<3>() = left_jacobian_so3(error.tail<3>()).inverse() * (to.p - turn * from.p);
  return error;
}

/// Ad(X): converts an error on the other side of X to one on the world's side.
[[nodiscard]] inline Matrix6d adjoint(const Pose& X) {
  const Eigen::Matrix3d R = X.rotation();
  Matrix6d Ad;
  Ad << R, skew(X.p) * R, Eigen::Matrix3d::Zero(), R;
  return Ad;
}

/// ∂ (position, rotation vector, both W axes) / ∂ ξ of a pose at p: δp = ρ + φ × p.
[[nodiscard]] inline Matrix6d plain_from_world_error(const Eigen::Vector3d& p) {
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() = -skew(p);
  return J;
}

/// Inverse of plain_from_world_error().
[[nodiscard]] inline Matrix6d world_from_plain_error(const Eigen::Vector3d& p) {
  Matrix6d J = Matrix6d::Identity();
  J.topRightCorner<3, 3>() = skew(p);
  return J;
}

}  // namespace fiducap::world
