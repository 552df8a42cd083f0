#pragma once

#include "capture/camera_frame.hpp"
#include "capture/gray_image.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// Along the edge of a tag36h11; TagFamilyFacts has those of other families.
inline constexpr int kDefaultCells = 8;

/// Sharpness and clipping of each side. Sharpness: mean step over two pixels across a side, divided
/// by the step from print to quiet zone. 1 is sharp; motion blur of b pixels across a side gives
/// about 2 / b. Does not depend on the light.
/// @param is_white_inside  of families with a reversed border
/// @return zeros where it cannot be measured
[[nodiscard]] std::array<TagSide, 4> measure_sides(const GrayImage& image,
                                                   const TagCorners& corners_px,
                                                   int cells = kDefaultCells,
                                                   bool is_white_inside = false);

/// Of the blurriest side, for `TagSighting::sharpness`.
[[nodiscard]] double least_sharpness(const std::array<TagSide, 4>& sides);

/// Errors of the sides found by TagDetector: from the size and slant of the tag in the image, the
/// sharpness of each side, and the noise relative to the contrast (decision margin).
///
/// Fitted to 16 000 rendered tags (752 × 480 with and without lens, 8 to 200 px, slants to 78°,
/// motion blur to 9 px, noise to 15 % of the contrast) without the 1 % that were off by more than a
/// pixel. There the chi-square of shifts and turns is 0.7 to 1.4 in nearly every bin. Blur below
/// half a cell adds nothing; beyond, errors are proportional to the noise (find_blurred_edge). The
/// two ends of a sharp side have the errors of a line through white noise. Saturated paper moves
/// sides inwards, by up to 0.5 px: the sigma is the mean over levels at which tags are decoded.
/// Blurred sides that could not be fitted have a sigma of one pixel. Errors of the lens, of stamps
/// and of paper that is not flat are not included; the caller adds them.
/// @param pixel_noise  CornerFrame::pixel_noise
/// @return zeros for a sighting without sharpness
[[nodiscard]] std::array<SideSigma, 4> side_sigmas(const TagSighting& tag, double pixel_noise,
                                                   int cells = kDefaultCells);

/// Adds the error that is the same in consecutive images, for filters: the bias of narrow cells by
/// their neighbours, which depends on lens and motion.
[[nodiscard]] std::array<SideSigma, 4> with_lasting_error(std::array<SideSigma, 4> sides,
                                                          const TagCorners& corners_px,
                                                          int cells = kDefaultCells);

/// 1-sigma of each coordinate of a corner, mean over the tag, raw pixels; 0: unknown.
[[nodiscard]] double corner_sigma_px(const TagCorners& corners_px,
                                     const std::array<SideSigma, 4>& sides);
[[nodiscard]] inline double corner_sigma_px(const TagSighting& tag, double pixel_noise) {
  return corner_sigma_px(tag.corners_px, side_sigmas(tag, pixel_noise));
}

}  // namespace fiducap
