#pragma once

#include <array>
#include <optional>

#include "capture/gray_image.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// Intersections of fitted sides.
struct FittedSides {
  TagCorners corners_px;
  /// Sides (from each corner to the next) that are blurred and do not match the model of a blurred
  /// side: the line through their steepest points is used, which may be a pixel off.
  std::array<bool, 4> guessed{};
};

/// Share of a side that a fit skips at each end: corners are rounded by pixels.
[[nodiscard]] double skipped_end(double length_px);

/// Fits the four sides of a tag, from corners good to about a pixel: straight lines through the
/// steepest points between black border and white quiet zone, and their intersections.
///
/// libapriltag does the same on whole pixels and with a fixed reach. Between pixels, on every row,
/// and with a reach proportional to the size of a cell, corners of rendered tags are two to six
/// times closer to the truth (small blurred ones hardly) and do not depend on the decimation of the
/// detection. About 100 µs per tag. Sides along the grid of pixels and sides of narrow cells are
/// located by the sum of their gray (SideScan::balance), sides blurred by motion over most of a
/// cell by a model of their gray (find_blurred_edge), sides along the motion without their ends.
/// @param corners_px  raw pixels, (0, 0) = centre of the upper-left one
/// @param cells       along the black border (8 for tag36h11)
/// @return nullopt where a side is not visible, or a corner would move by more than 1.5 cells
[[nodiscard]] std::optional<FittedSides> fit_sides(const GrayImage& image,
                                                   const TagCorners& corners_px, int cells);

}  // namespace fiducap
