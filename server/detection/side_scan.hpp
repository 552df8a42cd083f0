#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "capture/gray_image.hpp"

namespace fiducap {

/// Where a tag's side is, seen from one point near it: gray across the side, between pixels. All
/// lengths in pixels; `outward` has unit length.
struct SideScan {
  /// Borders narrower than this share their pixels with what lies on both sides of them.
  static constexpr double kAlone_px = 4.0;

  const GrayImage& image;
  double reach_px;     ///< How far from the point an edge is looked for …
  double gradient_px;  ///< … and over which distance, to both sides, its rise is taken.

  [[nodiscard]] bool holds(const Eigen::Vector2d& px) const {
    return px.x() >= 0 && px.y() >= 0 && px.x() < image.width - 1 && px.y() < image.height - 1;
  }

  /// Bilinear. @pre holds(px)
  [[nodiscard]] double gray(const Eigen::Vector2d& px) const {
    const int u = static_cast<int>(px.x());
    const int v = static_cast<int>(px.y());
    const double a = px.x() - u;
    const double b = px.y() - v;
    const std::uint8_t* p = image.pixels.data() +
                            static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) + u;
    return (1 - b) * ((1 - a) * p[0] + a * p[1]) +
           b * ((1 - a) * p[image.width] + a * p[image.width + 1]);
  }

  /// Where along `outward` gray rises, weighted by the square of the rise.
  struct Rise {
    double mean_px;
    double variance_px2;
  };
  /// Little noise, but drawn to the middle of pixels by up to 0.05 px where the image is sharp.
  /// @param most  brighter than this is not the tag's paper
  /// @return nullopt: it rises nowhere, or the image ends within reach
  [[nodiscard]] std::optional<Rise> rise(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                                         double most) const;

  /// How far the next modules pull a rise outwards: white bits inside of the border let it begin
  /// late, a dark wall beyond the quiet zone lets it end early.
  [[nodiscard]] double pull_px(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                               double module_px) const;

  /// Where along `outward` an edge must be for black and white on both sides of it to add up to the
  /// gray from `half_px` inside to `half_px` outside. Right wherever the edge meets the grid of
  /// pixels and behind any lens, when black and white are plain from there to `plain_px`.
  /// @return nullopt: no step from black to white, or the image ends
  [[nodiscard]] std::optional<double> balance(const Eigen::Vector2d& px,
                                              const Eigen::Vector2d& outward, double half_px,
                                              double plain_px) const;

 private:
  [[nodiscard]] double mean_gray(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                                 double from_px, double to_px) const;
};

}  // namespace fiducap
