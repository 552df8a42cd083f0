#pragma once

#include "capture/camera_frame.hpp"
#include "capture/gray_image.hpp"

namespace fiducap {

/// How well the sides of a tag were to be seen, for `TagSighting::sharpness`: the mean step over
/// two pixels across a side as a share of the step from print to quiet zone, of the side where it
/// is least. 1 is sharp; motion blur of b pixels across a side gives about 2 / b. Does not depend
/// on how well the room is lit.
/// @return 0 where there is nothing to measure
[[nodiscard]] double edge_sharpness(const GrayImage& image,
                                    const std::array<Eigen::Vector2d, 4>& corners_px);

/// What TagDetector's corners are off, 1-sigma of each coordinate, raw pixels: from the tag's size
/// and tilt in the image, the sharpness of its sides, and the noise as a share of its contrast
/// (decision margin).
///
/// Fitted to 9000 rendered tags (752 × 480 with and without lens, 8 to 200 px, tilts to 78°,
/// motion blur to 9 px, noise to 15 % of the contrast) without the 1 % that were off by more than a
/// pixel. There the chi-square of a coordinate is 0.8 to 1.35 in nearly every bin; the exception:
/// 0.6 below 12 px. A smear of less than a third of a
/// module costs nothing; beyond, errors go by the noise, as grays have to be told apart
/// (smeared_side.hpp). Errors of neighbouring corners
/// correlate with −0.2, those of opposite ones hardly. Lens calibration, stamps and paper that is
/// not flat are not in it: the caller adds what it knows of them.
/// @param pixel_noise  CornerFrame::pixel_noise
/// @return 0 for a sighting whose source did not measure its sharpness
[[nodiscard]] double corner_sigma_px(const TagSighting& tag, double pixel_noise);

}  // namespace fiducap
