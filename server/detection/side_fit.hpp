#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "capture/gray_image.hpp"

namespace fiducap {

/// Where fitted sides meet.
struct FittedSides {
  std::array<Eigen::Vector2d, 4> corners_px;
  /// Sides (from each corner to the next) that are smeared but do not look as smeared sides do:
  /// their place is the steepest one, which may be a pixel off.
  std::array<bool, 4> guessed{};

  const Eigen::Vector2d& operator[](std::size_t i) const { return corners_px[i]; }
};

/// What a fit leaves out at each end of a side, as a share of it: corners are rounded by pixels.
[[nodiscard]] double left_out_at_ends(double length_px);

/// Fits the four sides of a tag again, from corners that are good to a pixel or so: straight lines
/// through the places of steepest gray between black border and white quiet zone, and where they
/// meet.
///
/// libapriltag does the same on whole pixels and with a fixed reach. Between pixels, on every row,
/// and with a reach that follows the size of a module, corners of rendered tags are two to six
/// times closer to the truth (small smeared ones hardly), and no longer depend on the decimation
/// that the tag was found with. Some 100 µs per tag. Sides along the grid of pixels and those of
/// narrow modules are fitted by what their gray adds up to (side_scan.hpp), sides smeared by motion
/// over most of a module by what it adds up from (smeared_side.hpp); sides along the motion without
/// their ends.
/// @param corners_px  raw pixels, (0, 0) = centre of the upper-left one
/// @param modules     along the black border (8 for tag36h11)
/// @return nullopt where a side does not show, or the corners would move by more than 1.5 modules
[[nodiscard]] std::optional<FittedSides> fit_sides(const GrayImage& image,
                                                   const std::array<Eigen::Vector2d, 4>& corners_px,
                                                   int modules);

}  // namespace fiducap
