#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "capture/camera_frame.hpp"
#include "capture/gray_image.hpp"

namespace fiducap {

/// How an image is exposed, and how sharp its sharpest edges are: for people who set a camera up.
struct ImageMeasures {
  static constexpr std::size_t kBins = 64;

  std::array<std::uint32_t, kBins> histogram{};  ///< Of 256 / kBins grays each.
  double mean{};                                 ///< Gray, 0 … 255.
  double black{}, white{};                       ///< 1 % of the pixels are darker, 1 % brighter.
  double dark_share{}, bright_share{};           ///< At the lower and the upper end of the sensor.
  /// The steepest steps over two pixels as a share of white − black, as TagSighting::sharpness of
  /// the best edge anywhere: near 1 is sharp. 0: an image without contrast.
  double steepest{};
};

/// Of every second pixel of every second row; some hundred µs, no allocation.
[[nodiscard]] ImageMeasures measure(const GrayImage& image);

/// How far the tags' sides are smeared, raw pixels: 2 is sharp (TagSide::sharpness of 1).
struct ImageBlur {
  int tags{};           ///< That were measured; 0: nothing is known.
  double focus_px{};    ///< In every direction: the lens is out of focus, or nothing is, then 2 …
  double motion_px{};   ///< … and so much in one direction beyond that: the camera moved.
  double motion_rad{};  ///< That direction, from u (right) towards v (down), -π/2 … π/2.
};

/// Squared smears across the sides are fitted by an ellipse: what is round is the lens, what is
/// long is motion.
[[nodiscard]] ImageBlur blur_of(std::span<const TagSighting> tags);

}  // namespace fiducap
