#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "capture/camera_frame.hpp"
#include "capture/gray_image.hpp"
#include "detection/detector_config.hpp"

namespace fiducap {

/// Exposure of an image and sharpness of its sharpest edges, for setting up a camera.
struct ImageMeasures {
  static constexpr std::size_t kBins = 64;

  std::array<std::uint32_t, kBins> histogram{};  ///< Of 256 / kBins grays each.
  double mean{};                                 ///< Gray, 0 … 255.
  double black{}, white{};                       ///< 1 % of the pixels are darker, 1 % brighter.
  double dark_share{}, bright_share{};           ///< Black and saturated pixels.
  /// The steepest steps over two pixels relative to white − black, like TagSighting::sharpness of
  /// the best edge of the image: near 1 is sharp. 0: an image without contrast.
  double steepest{};
  /// The same along the direction with the least steep steps, of four: motion blur.
  double least_steep{};
};

/// Of every second pixel of every second row; some hundred µs, no allocation.
[[nodiscard]] ImageMeasures measure(const GrayImage& image);

/// Blur of the tags' sides, raw pixels: 2 is sharp (TagSide::sharpness of 1).
struct ImageBlur {
  int tags{};           ///< Measured; 0: unknown.
  double focus_px{};    ///< In every direction: defocus; 2 when sharp.
  double motion_px{};   ///< Additional blur in one direction: the camera moved.
  double motion_rad{};  ///< That direction, from u (right) towards v (down), -π/2 … π/2.
};

/// Fits an ellipse to the squared blur across the sides: its round part is defocus, the excess of
/// its longer axis motion.
[[nodiscard]] ImageBlur blur_of(std::span<const TagSighting> tags);

/// 1-sigma of the white noise of the pixels, of 255, from some thousand of them (tens of µs, no
/// allocation). Method: J. Immerkær, "Fast noise variance estimation", CVIU 1996, with the lower
/// quartile instead of the mean, so that texture on half of the image does not count as noise.
/// Skips clipped pixels.
/// @return nullopt when it cannot be measured (tiny image, or almost all of it clipped)
[[nodiscard]] std::optional<double> pixel_noise(const GrayImage& image);

/// DetectionPass::contrast for pixels with this noise: just above the range that noise alone causes
/// in a neighbourhood, so that flat parts of the image cost nothing, but not above a tag of
/// `min_decision_margin`.
[[nodiscard]] int contrast_above(double noise, const DetectorConfig& config);

}  // namespace fiducap
