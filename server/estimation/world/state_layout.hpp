#pragma once

#include <Eigen/Core>

namespace fiducap::world {

/// Where each error block stands in the covariance. Every block that images say something of is
/// three wide, in W axes but for biases and clocks.
///
/// The error of every pose is on the world's side: X = Exp(ξ) X̂, ξ = (ρ, φ): q = exp(φ) q̂, p =
/// exp(φ) p̂ + J_l(φ) ρ, and of the velocity v = exp(φ) v̂ + J_l(φ) ν (right-invariant error: Barrau
/// & Bonnabel, arXiv 1510.06263; Hartley et al., IJRR 2020; each tag carries its own rotation, the
/// decoupled form). Moving or turning the whole room is then the same ξ for the body and for every
/// tag, whatever the estimates are, so no image can seem to tell where the room is.
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
/// Clock of camera c: time shift, s; readout, s; then its lens's focal length, relative.
[[nodiscard]] constexpr int clock(int camera) { return layout::camera(camera) + kPoseSize; }
/// What may be wrong about camera c, one after the other: readout, s; focal length, relative;
/// principal point u, v, px; first coefficient of distortion.
[[nodiscard]] constexpr int readout(int camera) { return clock(camera) + 1; }
[[nodiscard]] constexpr int focal(int camera) { return clock(camera) + 2; }
[[nodiscard]] constexpr int centre(int camera) { return clock(camera) + 3; }
[[nodiscard]] constexpr int distortion(int camera) { return clock(camera) + 5; }
/// Print sizes, relative: of all tags together, then of those that are watched one by one.
inline constexpr int kWatchedPrints = 5;
[[nodiscard]] constexpr int sizes(int cameras) { return kBodySize + kCameraSize * cameras; }
[[nodiscard]] constexpr int print(int cameras, int watched) { return sizes(cameras) + 1 + watched; }
/// Gravity minus the configured value, m/s².
[[nodiscard]] constexpr int gravity(int cameras) { return sizes(cameras) + 1 + kWatchedPrints; }
/// Tag i: ρ, φ.
[[nodiscard]] constexpr int tag(int cameras, int i) { return gravity(cameras) + 1 + kPoseSize * i; }
}  // namespace layout

using BodyMatrix = Eigen::Matrix<double, layout::kBodySize, layout::kBodySize>;

}  // namespace fiducap::world
