#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "capture/gray_image.hpp"
#include "detection/tag_detector.hpp"

namespace fiducap {

/// An image and two smaller ones, each half as wide as the one before. The image itself is shared,
/// not copied; the memory of the others is kept.
///
/// Pixel (0, 0) is the centre of the first pixel at every level: u_coarse = (u_fine − 0.5) / 2.
class ImagePyramid final {
 public:
  static constexpr std::size_t kLevels = 3;

  struct Level {
    const std::uint8_t* pixels{};
    int width{};
    int height{};
    [[nodiscard]] const std::uint8_t* row(int v) const {
      return pixels + static_cast<std::ptrdiff_t>(v) * width;
    }
  };

  void build(std::shared_ptr<const GrayImage> image);
  [[nodiscard]] bool empty() const { return image_ == nullptr; }
  [[nodiscard]] const GrayImage& image() const { return *image_; }
  /// @pre !empty()
  [[nodiscard]] Level level(std::size_t k) const;

 private:
  std::shared_ptr<const GrayImage> image_;
  std::array<GrayImage, kLevels - 1> smaller_;
};

/// Finds the best point of a region to track: J. Shi, C. Tomasi, "Good features to track", CVPR
/// 1994. Keeps its memory.
class CornerFinder final {
 public:
  /// Whether a point of the region may be returned.
  using Allowed = std::function<bool(int u, int v)>;

  /// Allocates memory for regions of this size.
  void reserve(std::size_t pixels);
  /// @param region  lies in the image; its outermost pixels are skipped
  /// @param least   smallest eigenvalue of the mean of g gᵀ around the point, grays² / px²
  /// @return raw pixel, the intersection of the edges around (W. Förstner, E. Gülch, 1987), which
  /// does not move when its surroundings are scaled or rotated
  [[nodiscard]] std::optional<Eigen::Vector2d> best(const GrayImage& image,
                                                    const ImageRegion& region, float least,
                                                    const Allowed& allowed);

 private:
  void differentiate(const GrayImage& image, const ImageRegion& region);
  void sum_over_windows(int width, int height);

  std::vector<float> xx_, xy_, yy_;  ///< Products of gradients, then their sums over a window.
  std::vector<float> row_sums_;      ///< Intermediate sums along rows.
};

/// Finds the surroundings of a point in another image: Lucas and Kanade's flow in its inverse form
/// (S. Baker, I. Matthews, "Lucas-Kanade 20 years on", IJCV 2004), translation only, from coarse to
/// fine, independent of brightness. Unlike OpenCV's it allocates nothing and starts no threads.
namespace patch_flow {

inline constexpr int kHalf = 6;  ///< From the middle of a patch to its border, px at every level.
inline constexpr int kSide = 2 * kHalf + 1;

/// @param px     in `from`, raw pixels
/// @param guess  in `to`: within some ten pixels of the truth
/// @return nullopt: too near the border, without structure, or not found
[[nodiscard]] std::optional<Eigen::Vector2d> follow(const ImagePyramid& from,
                                                    const Eigen::Vector2d& px,
                                                    const ImagePyramid& to,
                                                    const Eigen::Vector2d& guess);

/// Smallest useful eigenvalue of the mean of g gᵀ over a patch, grays² / px²: at three grays of
/// noise the position has a sigma of about a tenth of a pixel.
inline constexpr float kLeastStructure = 9.0F;

}  // namespace patch_flow

}  // namespace fiducap
