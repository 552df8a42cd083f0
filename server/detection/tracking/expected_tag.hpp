#pragma once

#include <array>

#include <Eigen/Core>

namespace fiducap {

/// Where a tag should appear in an image that is about to be searched. Made by what knows the
/// motion.
struct ExpectedTag {
  int tag_id{};
  /// Raw (distorted) pixels, in the order of TagSighting; may lie outside of the image.
  std::array<Eigen::Vector2d, 4> corners_px{};
  double sigma_px{};  ///< 1-sigma of each coordinate.
  bool known{true};   ///< False: seen before, but its place in the room is unknown.
};

}  // namespace fiducap
