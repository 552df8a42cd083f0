#pragma once

#include <Eigen/Core>

namespace fiducap::robocentric {

/// Where each error block stands in the covariance. Every block is three wide.
namespace layout {
inline constexpr int kPosition = 0;  ///< p_WB_B, B axes, m.
inline constexpr int kVelocity = 3;  ///< v_WB_B, B axes, m/s.
inline constexpr int kAttitude = 6;  ///< q_WB = q̂_WB exp(δ), δ in B axes, rad.
inline constexpr int kBiasF = 9;     ///< accelerometer bias, m/s².
inline constexpr int kBiasW = 12;    ///< gyro bias, rad/s.
inline constexpr int kBodySize = 15;
/// Motion since the last image (X_B0B, B axes), only while propagating: right after the body.
inline constexpr int kStepPosition = 15;
inline constexpr int kStepAttitude = 18;
inline constexpr int kMotionSize = 21;

inline constexpr int kPoseSize = 6;
/// Camera c: p_BV (B axes) then rotation, q_BV = exp(δ) q̂_BV, δ in B axes.
[[nodiscard]] constexpr int extrinsics(int camera) { return kBodySize + kPoseSize * camera; }
/// Tag i: p_VT (V axes of camera 0) then rotation, q_VT = exp(δ) q̂_VT, δ in V axes.
[[nodiscard]] constexpr int tag(int cameras, int i) {
  return kBodySize + kPoseSize * (cameras + i);
}
}  // namespace layout

using BodyMatrix = Eigen::Matrix<double, layout::kBodySize, layout::kBodySize>;
using MotionMatrix = Eigen::Matrix<double, layout::kMotionSize, layout::kMotionSize>;
using MotionFromBody = Eigen::Matrix<double, layout::kMotionSize, layout::kBodySize>;
using Matrix3x6d = Eigen::Matrix<double, 3, 6>;

}  // namespace fiducap::robocentric
