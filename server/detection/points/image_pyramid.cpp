#include "detection/points/image_pyramid.hpp"

#include <utility>

namespace fiducap {

namespace {

/// Each pixel the mean of four.
void halve(const ImagePyramid::Level& fine, GrayImage& out) {
  out.resize(fine.width / 2, fine.height / 2);
  for (int v = 0; v < out.height; ++v) {
    const std::uint8_t* upper = fine.row(2 * v);
    const std::uint8_t* lower = fine.row(2 * v + 1);
    std::uint8_t* to = out.pixels.data() + static_cast<std::ptrdiff_t>(v) * out.width;
    for (int u = 0; u < out.width; ++u) {
      const int sum = upper[2 * u] + upper[2 * u + 1] + lower[2 * u] + lower[2 * u + 1];
      to[u] = static_cast<std::uint8_t>((sum + 2) / 4);
    }
  }
}

ImagePyramid::Level level_of(const GrayImage& image) {
  return {image.pixels.data(), image.width, image.height};
}

}  // namespace

void ImagePyramid::build(std::shared_ptr<const GrayImage> image) {
  image_ = std::move(image);
  for (std::size_t k = 0; k < smaller_.size(); ++k) halve(level(k), smaller_[k]);
}

ImagePyramid::Level ImagePyramid::level(std::size_t k) const {
  return level_of(k == 0 ? *image_ : smaller_[k - 1]);
}

}  // namespace fiducap
