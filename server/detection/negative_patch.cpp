#include "detection/negative_patch.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

// What side_fit looks at beyond a tag: modules, of the tag's longest side, and pixels.
constexpr double kAround = 3.0;
constexpr double kAround_px = 8.0;
constexpr int kWhitest = 255;

struct Span {
  int first, last;

  [[nodiscard]] int size() const { return std::max(0, last - first); }
};

Span within(double low, double high, int size) {
  return {static_cast<int>(std::clamp(std::floor(low), 0.0, double(size))),
          static_cast<int>(std::clamp(std::ceil(high) + 1, 0.0, double(size)))};
}

}  // namespace

void NegativePatch::cut(const GrayImage& image, const std::array<Eigen::Vector2d, 4>& corners_px,
                        int modules) {
  Eigen::Vector2d low = corners_px[0];
  Eigen::Vector2d high = corners_px[0];
  double longest_px = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    low = low.cwiseMin(corners_px[i]);
    high = high.cwiseMax(corners_px[i]);
    longest_px = std::max(longest_px, (corners_px[(i + 1) % 4] - corners_px[i]).norm());
  }
  const double around_px = kAround_px + kAround * longest_px / modules;
  const Span columns = within(low.x() - around_px, high.x() + around_px, image.width);
  const Span rows = within(low.y() - around_px, high.y() + around_px, image.height);
  origin_px_ = {columns.first, rows.first};
  negative_.resize(columns.size(), rows.size());
  auto out = negative_.pixels.begin();
  for (int row = rows.first; row < rows.last; ++row) {
    const auto first = image.pixels.begin() + std::ptrdiff_t{row} * image.width;
    out = std::transform(first + columns.first, first + columns.last, out, [](std::uint8_t gray) {
      return static_cast<std::uint8_t>(kWhitest - gray);
    });
  }
}

}  // namespace fiducap
