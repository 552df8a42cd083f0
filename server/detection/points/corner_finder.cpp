#include "detection/points/corner_finder.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

namespace fiducap {

namespace {

constexpr int kHalf =
    3;  // of the window: narrower than a patch, so that the corner is in its middle
constexpr int kSide = 2 * kHalf + 1;

/// Sums of kSide neighbours along a line of `count`; the first and last kHalf are left as they are.
void slide(const float* in, float* out, int count, int stride) {
  float sum = 0;
  for (int i = 0; i < count; ++i) {
    sum += in[i * stride];
    if (i >= kSide) sum -= in[(i - kSide) * stride];
    if (i >= kSide - 1) out[(i - kHalf) * stride] = sum;
  }
}

}  // namespace

void CornerFinder::differentiate(const GrayImage& image, const ImageRegion& region) {
  const int width = region.width();
  for (std::vector<float>* sums : {&xx_, &xy_, &yy_, &row_sums_}) {
    sums->resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(region.height()));
  }
  for (int v = region.top; v < region.bottom; ++v) {
    const int above = std::max(v - 1, 0);
    const int below = std::min(v + 1, image.height - 1);
    const std::uint8_t* upper =
        image.pixels.data() + static_cast<std::ptrdiff_t>(above) * image.width;
    const std::uint8_t* here = image.pixels.data() + static_cast<std::ptrdiff_t>(v) * image.width;
    const std::uint8_t* lower =
        image.pixels.data() + static_cast<std::ptrdiff_t>(below) * image.width;
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(v - region.top) * width - region.left;
    for (int u = std::max(region.left, 1); u < std::min(region.right, image.width - 1); ++u) {
      const float gx = 0.5F * static_cast<float>(here[u + 1] - here[u - 1]);
      const float gy = 0.5F * static_cast<float>(lower[u] - upper[u]);
      xx_[static_cast<std::size_t>(at + u)] = gx * gx;
      xy_[static_cast<std::size_t>(at + u)] = gx * gy;
      yy_[static_cast<std::size_t>(at + u)] = gy * gy;
    }
  }
}

void CornerFinder::sum_up(int width, int height) {
  for (std::vector<float>* products : {&xx_, &xy_, &yy_}) {
    for (int r = 0; r < height; ++r)
      slide(products->data() + r * width, row_sums_.data() + r * width, width, 1);
    // Down the columns, whole rows at a time.
    std::vector<float>& out = *products;
    for (int r = kHalf; r < height - kHalf; ++r) {
      float* to = out.data() + r * width;
      std::fill(to, to + width, 0.0F);
      for (int k = -kHalf; k <= kHalf; ++k) {
        const float* from = row_sums_.data() + (r + k) * width;
        for (int c = kHalf; c < width - kHalf; ++c) to[c] += from[c];
      }
    }
  }
}

void CornerFinder::reserve(std::size_t pixels) {
  for (std::vector<float>* sums : {&xx_, &xy_, &yy_, &row_sums_}) sums->reserve(pixels);
}

Eigen::Vector2d CornerFinder::meeting_point(const GrayImage& image, const Eigen::Vector2d& px) {
  constexpr int kReach = 4;
  const int u0 = static_cast<int>(px.x());
  const int v0 = static_cast<int>(px.y());
  if (u0 <= kReach || v0 <= kReach || u0 + kReach + 1 >= image.width ||
      v0 + kReach + 1 >= image.height)
    return px;
  Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  for (int y = -kReach; y <= kReach; ++y) {
    const std::uint8_t* row =
        image.pixels.data() + static_cast<std::ptrdiff_t>(v0 + y) * image.width + u0;
    for (int x = -kReach; x <= kReach; ++x) {
      const Eigen::Vector2d g(0.5 * (row[x + 1] - row[x - 1]),
                              0.5 * (row[x + image.width] - row[x - image.width]));
      // The tangent through (x, y) at right angles to g passes through the corner.
      A += g * g.transpose();
      b += g * g.dot(Eigen::Vector2d(x, y));
    }
  }
  const Eigen::Vector2d offset = A.inverse() * b;
  return offset.norm() < kReach ? Eigen::Vector2d(px + offset) : px;  // NaN stays where it was
}

std::optional<Eigen::Vector2d> CornerFinder::best(const GrayImage& image, const ImageRegion& region,
                                                  float least, const Allowed& allowed) {
  const int width = region.width();
  const int height = region.height();
  if (width <= kSide || height <= kSide) return std::nullopt;
  differentiate(image, region);
  sum_up(width, height);
  float score = least * kSide * kSide;
  std::optional<Eigen::Vector2d> found;
  // A corner is the best of its surroundings: every second pixel is looked at, which costs half a
  // pixel of place at most.
  for (int r = kHalf; r < height - kHalf; r += 2) {
    for (int c = kHalf; c < width - kHalf; c += 2) {
      const auto i = static_cast<std::size_t>(r * width + c);
      const float difference = xx_[i] - yy_[i];
      const float root = std::sqrt(difference * difference + 4 * xy_[i] * xy_[i]);
      const float value = 0.5F * (xx_[i] + yy_[i] - root);
      if (value <= score || !allowed(region.left + c, region.top + r)) continue;
      score = value;
      found = Eigen::Vector2d(region.left + c, region.top + r);
    }
  }
  return found ? std::optional(meeting_point(image, *found)) : std::nullopt;
}

}  // namespace fiducap
