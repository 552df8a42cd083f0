#pragma once

#include <array>
#include <cmath>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

using Vector8d = Eigen::Matrix<double, 8, 1>;
using Matrix86d = Eigen::Matrix<double, 8, 6>;
using Matrix8d = Eigen::Matrix<double, 8, 8>;

/// Size of a tag in the image.
struct TagOutline {
  double longest_px{};  ///< Longest side.
  double width_px{};    ///< Area over the longest side: distance of the closer opposite sides.
};
[[nodiscard]] TagOutline outline_of(const TagCorners& corners_px);

/// Bounding box of a tag.
struct PixelBox {
  Eigen::Vector2d low, high;
};
[[nodiscard]] PixelBox bounds_of(const TagCorners& corners_px);

/// Mean of the corners.
[[nodiscard]] inline Eigen::Vector2d centre_of(const TagCorners& px) {
  return 0.25 * (px[0] + px[1] + px[2] + px[3]);
}

/// Corner i of a tag with this edge in tag axes T (x right, y up, z out of the face); bottom-left
/// first.
[[nodiscard]] Eigen::Vector3d tag_corner(int i, double edge_m);

/// The four corners of one tag, measured minus predicted: innovation y_i of RCARS II-D4 in raw
/// pixels, and the derivatives of the prediction.
struct CornerResidual {
  /// Carried back through the lens into raw pixels, where the noise is white.
  Vector8d y{Vector8d::Zero()};
  /// ∂ predicted / ∂ (p_VT, rotation vector of the tag in V axes), raw pixels.
  Matrix86d H{Matrix86d::Zero()};
  /// ∂ predicted / ∂ size, relative to the assumed one, raw pixels.
  Vector8d H_size{Vector8d::Zero()};
  /// ∂ predicted / ∂ first distortion coefficient, raw pixels.
  Vector8d H_k1{Vector8d::Zero()};
  bool in_front{true};  ///< False: a corner lies behind the camera; y and H are invalid.

  [[nodiscard]] double rms_px() const { return std::sqrt(y.squaredNorm() / 4.0); }
};

/// @param size  factor on the configured edge
/// @param k1    first distortion coefficient minus that of `camera`, which undistorted the corners
[[nodiscard]] CornerResidual corner_residual(const TagObservation& seen, const Pose& X_VT,
                                             const CameraModel& camera, double size = 1.0,
                                             double k1 = 0.0);

/// Covariance of the corners of a tag as intersections of fitted sides: largest along the diagonal
/// of a slanted tag and across the motion of a blurred one; the ends of a side are correlated.
/// @param corners_px  in the pixels of the sigmas
[[nodiscard]] Matrix8d corner_covariance(const TagCorners& corners_px,
                                         const std::array<SideSigma, 4>& sides);

/// One of the two poses that four coplanar corners allow.
struct TagPose {
  Pose X_VT;        ///< Tag in camera axes.
  double rms_px{};  ///< Reprojection error, root mean square over the corners, raw pixels.
};

/// Both planar solutions, the better one first. When the second is impossible it repeats the first
/// with rms_px = inf. Method: T. Collins, A. Bartoli, "Infinitesimal plane-based pose estimation",
/// IJCV 2014, each refined by Levenberg–Marquardt on the corners. Allocates nothing.
[[nodiscard]] std::array<TagPose, 2> solve_tag_pose(const TagObservation& tag,
                                                    const CameraModel& camera);

/// Pose of a tag with known attitude: least squares over its position.
/// @param p_VT  start value, e.g. of one of the planar poses
[[nodiscard]] Pose solve_tag_position(const TagObservation& tag, const CameraModel& camera,
                                      const Eigen::Quaterniond& q_VT, const Eigen::Vector3d& p_VT);

}  // namespace fiducap
