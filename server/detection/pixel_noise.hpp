#pragma once

#include <optional>

#include "capture/gray_image.hpp"
#include "detection/detector_config.hpp"

namespace fiducap {

/// 1-sigma of the white noise of the pixels, of 255, from some thousand of them (tens of µs, no
/// allocation). Method: J. Immerkær, "Fast noise variance estimation", CVIU 1996, with the lower
/// quartile instead of the mean, so that texture on half of the image does not count as noise;
/// clipped pixels are passed over.
/// @return nullopt for an image that has nothing to measure (tiny, or almost all of it clipped)
[[nodiscard]] std::optional<double> pixel_noise(const GrayImage& image);

/// DetectionPass::contrast for pixels with this noise: just above what noise alone shows in a
/// neighbourhood, so that flat parts of the image cost nothing, and never so high that a tag of
/// `min_decision_margin` is passed over.
[[nodiscard]] int contrast_above(double noise, const DetectorConfig& config);

}  // namespace fiducap
