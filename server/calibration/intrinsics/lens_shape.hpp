#pragma once

#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// What a lens does to its image, whatever residuals say about it.
struct LensShape {
  double folded{};  ///< Share of the image, corners too, that no ray reaches: the lens maps two
                    ///< directions to one pixel before.
  double behind{};  ///< Share that only rays from beside or behind the camera reach.
  double aspect{};  ///< fu / fv.
  double pixel_aspect{};  ///< Of the pixel shapes that are built, the one nearest to it; 1: square.
  double aspect_off{};    ///< How far `aspect` is from it, relative.
  double centre_off{};    ///< Principal point off the middle of the image, in widths or heights,
                          ///< whichever is more.
};

/// Looks at a raster of pixels out to the corners of the image.
[[nodiscard]] LensShape shape_of(const CameraModel& camera);

/// What no camera does: a part of the image that is folded, focal lengths that no pixel explains,
/// an axis that leaves the image. Such numbers fit the corners and nothing else.
inline constexpr double kMostFolded = 0.02;
inline constexpr double kMostAspectOff = 0.02;      // of square pixels …
inline constexpr double kMostOddAspectOff = 0.005;  // … of others: many ratios are near one of them
inline constexpr double kMostCentreOff = 0.3;
[[nodiscard]] bool can_be_a_lens(const LensShape& shape);

}  // namespace fiducap
