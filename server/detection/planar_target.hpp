#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "capture/gray_image.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// Inner corners of a checkerboard, row by row; the whole board must be in view.
/// Method: A. Duda, U. Frese, "Accurate detection and localization of checkerboard corners for
/// calibration", BMVC 2018 (OpenCV findChessboardCornersSB).
/// @param columns, rows  inner corners, 3 or more each: one less than squares
/// @return raw pixels, (0, 0) = centre of the upper-left pixel; nullopt when there is no such board
[[nodiscard]] std::optional<std::vector<Eigen::Vector2d>> find_checkerboard(const GrayImage& image,
                                                                            int columns, int rows);

/// The poses that points of one plane allow, the one that fits better first: two, one, or none when
/// fewer than four points can be undistorted. First guesses, not least squares.
/// Method: T. Collins, A. Bartoli, "Infinitesimal plane-based pose estimation", IJCV 2014 (OpenCV
/// IPPE).
/// @param points  target axes, z = 0, not collinear
/// @param raw_px  their measured pixels; those outside of the lens model are not used
[[nodiscard]] std::vector<Pose> solve_plane_pose(std::span<const Eigen::Vector3d> points,
                                                 std::span<const Eigen::Vector2d> raw_px,
                                                 const CameraModel& camera);

}  // namespace fiducap
