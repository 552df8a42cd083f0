#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "capture/gray_image.hpp"
#include "detection/tag_detector.hpp"

namespace fiducap {

/// Finds the point of a region that is best followed: J. Shi, C. Tomasi, "Good features to track",
/// CVPR 1994. Keeps its memory.
class CornerFinder final {
 public:
  /// A point of the region may be taken when this says so.
  using Allowed = std::function<bool(int u, int v)>;

  /// Memory for regions of so many pixels.
  void reserve(std::size_t pixels);
  /// @param region   lies in the image; its outermost pixels are passed over
  /// @param least    least eigenvalue of the mean of g gᵀ around the point, grays² / px²
  /// @return raw pixel: where the edges around meet (W. Förstner, E. Gülch, 1987), so that the
  /// point stays in place when its
  ///         surroundings are seen larger or turned
  [[nodiscard]] std::optional<Eigen::Vector2d> best(const GrayImage& image,
                                                    const ImageRegion& region, float least,
                                                    const Allowed& allowed);

 private:
  void differentiate(const GrayImage& image, const ImageRegion& region);
  void sum_up(int width, int height);
  [[nodiscard]] static Eigen::Vector2d meeting_point(const GrayImage& image,
                                                     const Eigen::Vector2d& px);

  std::vector<float> xx_, xy_, yy_;  ///< Products of gradients, then their sums over a window …
  std::vector<float> row_sums_;      ///< … by way of the sums along rows.
};

}  // namespace fiducap
