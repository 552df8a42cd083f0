#pragma once

#include <array>

#include <Eigen/Core>

#include "capture/gray_image.hpp"

namespace fiducap {

/// A tag and what is around it with black and white exchanged: tags with a white border in a black
/// one become black ones in a white one, so that one fit of sides does for both. Keeps its pixels
/// for the next tag.
class NegativePatch final {
 public:
  /// @param modules  along the edge; three of them around the tag come along
  void cut(const GrayImage& image, const std::array<Eigen::Vector2d, 4>& corners_px, int modules);

  [[nodiscard]] const GrayImage& image() const { return negative_; }
  /// Of the patch's first pixel in the image it was cut from.
  [[nodiscard]] const Eigen::Vector2d& origin_px() const { return origin_px_; }

 private:
  GrayImage negative_;
  Eigen::Vector2d origin_px_{0, 0};
};

}  // namespace fiducap
