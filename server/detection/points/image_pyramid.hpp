#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "capture/gray_image.hpp"

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

}  // namespace fiducap
