#pragma once

#include <span>
#include <vector>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// The poses that points of one plane allow, the one that fits better first: one, two, or none
/// where the lens cannot be taken out of four of the points. First guesses, not least squares.
/// Method: T. Collins, A. Bartoli, "Infinitesimal plane-based pose estimation", IJCV 2014 (OpenCV
/// IPPE).
/// @param points  target axes, z = 0, not all on a line
/// @param raw_px  where they were seen; those outside of the lens model are left out
[[nodiscard]] std::vector<Pose> solve_plane_pose(std::span<const Eigen::Vector3d> points,
                                                 std::span<const Eigen::Vector2d> raw_px,
                                                 const CameraModel& camera);

}  // namespace fiducap
