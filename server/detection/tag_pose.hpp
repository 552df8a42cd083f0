#pragma once

#include <array>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/corner_projection.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// One of the two poses that four coplanar corners allow.
struct TagPose {
  Pose X_VT;        ///< Tag in camera axes.
  double rms_px{};  ///< Reprojection error of the four corners (root mean square over corners), raw
                    ///< pixels.
};

/// Both planar solutions, the better one first. When the second is impossible it repeats the first
/// with rms_px = inf. Method: T. Collins, A. Bartoli, "Infinitesimal plane-based pose estimation",
/// IJCV 2014 (OpenCV IPPE_SQUARE), each polished by Gauss–Newton on the corners.
[[nodiscard]] std::array<TagPose, 2> solve_tag_pose(const TagObservation& tag,
                                                    const CameraModel& camera);

/// Where a tag of known attitude stands: least squares over its position alone.
/// @param p_VT  start, e.g. of one of the planar poses
[[nodiscard]] Pose place_turned_tag(const TagObservation& tag, const CameraModel& camera,
                                    const Eigen::Quaterniond& q_VT, const Eigen::Vector3d& p_VT);

}  // namespace fiducap
