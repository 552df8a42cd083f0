#pragma once

#include <Eigen/Core>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

using Vector8d = Eigen::Matrix<double, 8, 1>;
using Matrix86d = Eigen::Matrix<double, 8, 6>;

/// Corner i of a tag with this edge in tag axes T (x right, y up, z out of the face); lower-left
/// first.
[[nodiscard]] Eigen::Vector3d tag_corner(int i, double edge_m);

/// The four corners of one tag against what was seen: innovation y_i of RCARS II-D4 in raw pixels,
/// and its derivative.
struct CornerResidual {
  /// seen − predicted, carried back through the lens into raw pixels, where the noise is white.
  Vector8d y{Vector8d::Zero()};
  /// ∂ predicted / ∂ (p_VT, rotation vector of the tag in V axes), raw pixels.
  Matrix86d H{Matrix86d::Zero()};
  /// ∂ predicted / ∂ size, relative to the one reckoned with, raw pixels.
  Vector8d H_size{Vector8d::Zero()};
  /// ∂ predicted / ∂ first coefficient of the lens's distortion, raw pixels.
  Vector8d H_k1{Vector8d::Zero()};
  bool in_front{true};  ///< False: a corner lies behind the camera, y and H mean nothing.

  [[nodiscard]] double rms_px() const { return std::sqrt(y.squaredNorm() / 4.0); }
};

/// @param size  so many times the configured edge
/// @param k1    how much larger the first coefficient of distortion is than `camera`, by which the
///              corners were undistorted, has it
[[nodiscard]] CornerResidual corner_residual(const TagObservation& seen, const Pose& X_VT,
                                             const CameraModel& camera, double size = 1.0,
                                             double k1 = 0.0);

}  // namespace fiducap
