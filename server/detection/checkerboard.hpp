#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "capture/gray_image.hpp"

namespace fiducap {

/// Inner corners of a checkerboard, row by row; the whole board must be in view.
/// Method: A. Duda, U. Frese, "Accurate detection and localization of checkerboard corners for
/// calibration", BMVC 2018 (OpenCV findChessboardCornersSB).
/// @param columns, rows  inner corners, 3 or more each: one less than squares
/// @return raw pixels, (0, 0) = centre of the upper-left pixel; nullopt when there is no such board
[[nodiscard]] std::optional<std::vector<Eigen::Vector2d>> find_checkerboard(const GrayImage& image,
                                                                            int columns, int rows);

}  // namespace fiducap
