#pragma once

#include "capture/camera_frame.hpp"
#include "capture/gray_image.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// Along the edge of a tag36h11; TagFamilyFacts has those of others.
inline constexpr int kUsualModules = 8;

/// How well the sides of a tag were to be seen, for `TagSighting::sides`: the mean step over two
/// pixels across a side as a share of the step from print to quiet zone. 1 is sharp; motion blur of
/// b pixels across a side gives about 2 / b. Does not depend on how well the room is lit.
/// @param is_white_inside  of families with a reversed border
/// @return zeros where there is nothing to measure
[[nodiscard]] std::array<TagSide, 4> look_at_sides(const GrayImage& image,
                                                   const std::array<Eigen::Vector2d, 4>& corners_px,
                                                   int modules = kUsualModules,
                                                   bool is_white_inside = false);

/// Of the side where it is least, for `TagSighting::sharpness`.
[[nodiscard]] double least_sharpness(const std::array<TagSide, 4>& sides);

/// What the sides are off that TagDetector's corners are made of: from the size and tilt of the tag
/// in the image, the sharpness of each side, and the noise as a share of the contrast (decision
/// margin).
///
/// Fitted to 16 000 rendered tags (752 × 480 with and without lens, 8 to 200 px, tilts to 78°,
/// motion blur to 9 px, noise to 15 % of the contrast) without the 1 % that were off by more than a
/// pixel. There the chi-square of shifts and turns is 0.7 to 1.4 in nearly every bin. A smear of
/// less than half a module costs nothing; beyond, errors go by the noise, as grays have to be told
/// apart (smeared_side.hpp). The two ends of a sharp side are off as a line through white noise is.
/// White paper at the sensor's end moves sides inwards, up to 0.5 px: believed by the mean over
/// what shows a tag at all. Smeared sides that could not be fitted are believed to a pixel. Lens
/// calibration, stamps and paper that is not flat are not in it: the caller adds what it
/// knows of them.
/// @param pixel_noise  CornerFrame::pixel_noise
/// @return zeros for a sighting whose source did not measure its sharpness
[[nodiscard]] std::array<SideSigma, 4> side_sigmas(const TagSighting& tag, double pixel_noise,
                                                   int modules = kUsualModules);

/// The same with what stays while a tag is seen from there, as a filter should believe it: of
/// narrow modules, how far their neighbours pull them, which goes by lens and motion.
[[nodiscard]] std::array<SideSigma, 4> with_what_lasts(
    std::array<SideSigma, 4> sides, const std::array<Eigen::Vector2d, 4>& corners_px,
    int modules = kUsualModules);

/// 1-sigma of each coordinate of a corner in the mean over the tag, raw pixels; 0: not known.
[[nodiscard]] double corner_sigma_px(const std::array<Eigen::Vector2d, 4>& corners_px,
                                     const std::array<SideSigma, 4>& sides);
[[nodiscard]] inline double corner_sigma_px(const TagSighting& tag, double pixel_noise) {
  return corner_sigma_px(tag.corners_px, side_sigmas(tag, pixel_noise));
}

}  // namespace fiducap
