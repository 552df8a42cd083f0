#include "detection/points/feature_points.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

namespace fiducap {
namespace {

/// Each pixel is the mean of four.
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

constexpr int kWindowHalf = 3;  // narrower than a patch, which centres the corner in it
constexpr int kWindowSide = 2 * kWindowHalf + 1;

const std::uint8_t* row_of(const GrayImage& image, int v) {
  return image.pixels.data() + static_cast<std::ptrdiff_t>(v) * image.width;
}

/// Sums of kWindowSide neighbours along a line of `count`, without the first and last kWindowHalf.
void slide(const float* in, float* out, int count, int stride) {
  float sum = 0;
  for (int i = 0; i < count; ++i) {
    sum += in[i * stride];
    if (i >= kWindowSide) sum -= in[(i - kWindowSide) * stride];
    if (i >= kWindowSide - 1) out[(i - kWindowHalf) * stride] = sum;
  }
}

/// Intersection of the edges around a point.
Eigen::Vector2d edge_intersection(const GrayImage& image, const Eigen::Vector2d& px) {
  constexpr int kReach = 4;
  const int u0 = static_cast<int>(px.x());
  const int v0 = static_cast<int>(px.y());
  if (u0 <= kReach || v0 <= kReach || u0 + kReach + 1 >= image.width ||
      v0 + kReach + 1 >= image.height)
    return px;
  Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  for (int y = -kReach; y <= kReach; ++y) {
    const std::uint8_t* row = row_of(image, v0 + y) + u0;
    for (int x = -kReach; x <= kReach; ++x) {
      const Eigen::Vector2d g(0.5 * (row[x + 1] - row[x - 1]),
                              0.5 * (row[x + image.width] - row[x - image.width]));
      // The line through (x, y) perpendicular to g passes through the corner.
      A += g * g.transpose();
      b += g * g.dot(Eigen::Vector2d(x, y));
    }
  }
  const Eigen::Vector2d offset = A.inverse() * b;
  return offset.norm() < kReach ? Eigen::Vector2d(px + offset) : px;  // px also for NaN
}

}  // namespace

void ImagePyramid::build(std::shared_ptr<const GrayImage> image) {
  image_ = std::move(image);
  for (std::size_t k = 0; k < smaller_.size(); ++k) halve(level(k), smaller_[k]);
}

ImagePyramid::Level ImagePyramid::level(std::size_t k) const {
  const GrayImage& image = k == 0 ? *image_ : smaller_[k - 1];
  return {image.pixels.data(), image.width, image.height};
}

void CornerFinder::differentiate(const GrayImage& image, const ImageRegion& region) {
  const int width = region.width();
  for (std::vector<float>* sums : {&xx_, &xy_, &yy_, &row_sums_})
    sums->resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(region.height()));
  for (int v = region.top; v < region.bottom; ++v) {
    const std::uint8_t* upper = row_of(image, std::max(v - 1, 0));
    const std::uint8_t* here = row_of(image, v);
    const std::uint8_t* lower = row_of(image, std::min(v + 1, image.height - 1));
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

void CornerFinder::sum_over_windows(int width, int height) {
  for (std::vector<float>* products : {&xx_, &xy_, &yy_}) {
    for (int r = 0; r < height; ++r)
      slide(products->data() + r * width, row_sums_.data() + r * width, width, 1);
    // Along the columns, by whole rows.
    std::vector<float>& out = *products;
    for (int r = kWindowHalf; r < height - kWindowHalf; ++r) {
      float* to = out.data() + r * width;
      std::fill(to, to + width, 0.0F);
      for (int k = -kWindowHalf; k <= kWindowHalf; ++k) {
        const float* from = row_sums_.data() + (r + k) * width;
        for (int c = kWindowHalf; c < width - kWindowHalf; ++c) to[c] += from[c];
      }
    }
  }
}

void CornerFinder::reserve(std::size_t pixels) {
  for (std::vector<float>* sums : {&xx_, &xy_, &yy_, &row_sums_}) sums->reserve(pixels);
}

std::optional<Eigen::Vector2d> CornerFinder::best(const GrayImage& image, const ImageRegion& region,
                                                  float least, const Allowed& allowed) {
  const int width = region.width();
  const int height = region.height();
  if (width <= kWindowSide || height <= kWindowSide) return std::nullopt;
  differentiate(image, region);
  sum_over_windows(width, height);
  float score = least * kWindowSide * kWindowSide;
  std::optional<Eigen::Vector2d> found;
  // Evaluating every second pixel costs an accuracy of at most half a pixel.
  for (int r = kWindowHalf; r < height - kWindowHalf; r += 2) {
    for (int c = kWindowHalf; c < width - kWindowHalf; c += 2) {
      const auto i = static_cast<std::size_t>(r * width + c);
      const float difference = xx_[i] - yy_[i];
      const float root = std::sqrt(difference * difference + 4 * xy_[i] * xy_[i]);
      const float value = 0.5F * (xx_[i] + yy_[i] - root);
      if (value <= score || !allowed(region.left + c, region.top + r)) continue;
      score = value;
      found = Eigen::Vector2d(region.left + c, region.top + r);
    }
  }
  return found ? std::optional(edge_intersection(image, *found)) : std::nullopt;
}

namespace patch_flow {

namespace {

constexpr int kRimmed = kSide + 2;  // one more pixel around, for the gradients
constexpr int kArea = kSide * kSide;
constexpr int kMostSteps = 12;
constexpr float kArrived_px = 0.01F;
constexpr float kFarthest_px = 12.0F;  // from the start of a level: beyond, another structure
// Largest difference of both patches, RMS in grays: a constant for noise, and relative to contrast.
constexpr float kMostResidual = 8.0F;
constexpr float kResidualShare = 0.35F;

/// Interpolates kWide × kWide pixels around (u, v). @return false: not inside of the image
template <int kWide>
bool sample(const ImagePyramid::Level& level, float u, float v,
            std::array<float, kWide * kWide>& out) {
  const float left = u - static_cast<float>(kWide / 2);
  const float top = v - static_cast<float>(kWide / 2);
  if (!(left >= 0 && top >= 0)) return false;  // also for NaN
  const int x = static_cast<int>(left);
  const int y = static_cast<int>(top);
  if (x + kWide >= level.width || y + kWide >= level.height) return false;
  const float across = left - static_cast<float>(x);
  const float down = top - static_cast<float>(y);
  const float a = (1 - across) * (1 - down);
  const float b = across * (1 - down);
  const float c = (1 - across) * down;
  const float d = across * down;
  for (int r = 0; r < kWide; ++r) {
    const std::uint8_t* upper = level.row(y + r) + x;
    const std::uint8_t* lower = level.row(y + r + 1) + x;
    float* to = out.data() + r * kWide;
    for (int k = 0; k < kWide; ++k)
      to[k] = a * static_cast<float>(upper[k]) + b * static_cast<float>(upper[k + 1]) +
              c * static_cast<float>(lower[k]) + d * static_cast<float>(lower[k + 1]);
  }
  return true;
}

/// Gaussian: under rotation and scaling the outer part of a patch moves differently, and would
/// cause a drift of the point. Sums to kArea.
const std::array<float, kArea>& weights() {
  static const std::array<float, kArea> all = [] {
    constexpr float kSigma_px = 2.5F;
    std::array<float, kArea> w{};
    float sum = 0;
    for (int i = 0; i < kArea; ++i) {
      const auto x = static_cast<float>(i % kSide - kHalf);
      const auto y = static_cast<float>(i / kSide - kHalf);
      w[static_cast<std::size_t>(i)] = std::exp(-0.5F * (x * x + y * y) / (kSigma_px * kSigma_px));
      sum += w[static_cast<std::size_t>(i)];
    }
    for (float& value : w) value *= kArea / sum;
    return w;
  }();
  return all;
}

/// The patch to find: grays, their gradients without mean, and the inverse of the gradients'
/// scatter.
struct Template {
  std::array<float, kArea> gray, gx, gy;  ///< Gradients weighted.
  float xx{}, xy{}, yy{};                 ///< inverse
  float mean{};
  float contrast{};  ///< RMS about the mean
};

bool make_template(const ImagePyramid::Level& level, float u, float v, Template& out) {
  std::array<float, kRimmed * kRimmed> rimmed;
  if (!sample<kRimmed>(level, u, v, rimmed)) return false;
  const std::array<float, kArea>& w = weights();
  float sum_x = 0;
  float sum_y = 0;
  float sum = 0;
  float squares = 0;
  for (int r = 0; r < kSide; ++r) {
    for (int k = 0; k < kSide; ++k) {
      const float* at = rimmed.data() + (r + 1) * kRimmed + k + 1;
      const auto i = static_cast<std::size_t>(r * kSide + k);
      out.gray[i] = at[0];
      out.gx[i] = 0.5F * (at[1] - at[-1]);
      out.gy[i] = 0.5F * (at[kRimmed] - at[-kRimmed]);
      sum_x += w[i] * out.gx[i];
      sum_y += w[i] * out.gy[i];
      sum += w[i] * at[0];
      squares += w[i] * at[0] * at[0];
    }
  }
  out.mean = sum / kArea;
  out.contrast = std::sqrt(std::max(0.0F, squares / kArea - out.mean * out.mean));
  float xx = 0;
  float xy = 0;
  float yy = 0;
  for (std::size_t i = 0; i < kArea; ++i) {
    out.gx[i] -= sum_x / kArea;
    out.gy[i] -= sum_y / kArea;
    xx += w[i] * out.gx[i] * out.gx[i];
    xy += w[i] * out.gx[i] * out.gy[i];
    yy += w[i] * out.gy[i] * out.gy[i];
    out.gx[i] *= w[i];
    out.gy[i] *= w[i];
  }
  const float least = 0.5F * (xx + yy - std::hypot(xx - yy, 2 * xy));
  if (!(least > kLeastStructure * kArea)) return false;
  const float determinant = xx * yy - xy * xy;
  out.xx = yy / determinant;
  out.xy = -xy / determinant;
  out.yy = xx / determinant;
  return true;
}

enum class Outcome { kFound, kLost };

/// Moves (u, v) to the patch that is most similar to the template.
/// @param residual  out: RMS of the difference
Outcome settle(const ImagePyramid::Level& level, const Template& wanted, float& u, float& v,
               float& residual) {
  std::array<float, kArea> gray;
  const std::array<float, kArea>& w = weights();
  const float from_u = u;
  const float from_v = v;
  for (int step = 0; step < kMostSteps; ++step) {
    if (!sample<kSide>(level, u, v, gray)) return Outcome::kLost;
    float bx = 0;
    float by = 0;
    float sum = 0;
    float squares = 0;
    for (std::size_t i = 0; i < kArea; ++i) {
      const float e = gray[i] - wanted.gray[i];
      bx += wanted.gx[i] * e;
      by += wanted.gy[i] * e;
      sum += w[i] * e;
      squares += w[i] * e * e;
    }
    residual = std::sqrt(std::max(0.0F, squares / kArea - sum * sum / (kArea * kArea)));
    const float du = wanted.xx * bx + wanted.xy * by;
    const float dv = wanted.xy * bx + wanted.yy * by;
    u -= du;
    v -= dv;
    if (!(std::hypot(u - from_u, v - from_v) < kFarthest_px)) return Outcome::kLost;
    if (std::hypot(du, dv) < kArrived_px) break;
  }
  return Outcome::kFound;
}

float to_level(double px, std::size_t level) {
  const double size = static_cast<double>(1 << level);
  return static_cast<float>((px + 0.5) / size - 0.5);
}

double from_level(float px, std::size_t level) {
  const double size = static_cast<double>(1 << level);
  return (static_cast<double>(px) + 0.5) * size - 0.5;
}

}  // namespace

std::optional<Eigen::Vector2d> follow(const ImagePyramid& from, const Eigen::Vector2d& px,
                                      const ImagePyramid& to, const Eigen::Vector2d& guess) {
  Template wanted;
  Eigen::Vector2d at = guess;
  for (std::size_t k = ImagePyramid::kLevels; k-- > 0;) {
    // Near the border, and where only the fine image has structure, coarse levels are skipped.
    if (!make_template(from.level(k), to_level(px.x(), k), to_level(px.y(), k), wanted)) {
      if (k == 0) return std::nullopt;
      continue;
    }
    float u = to_level(at.x(), k);
    float v = to_level(at.y(), k);
    float residual = 0;
    const bool found = settle(to.level(k), wanted, u, v, residual) == Outcome::kFound;
    if (k == 0) {
      if (!found || residual > std::max(kMostResidual, kResidualShare * wanted.contrast))
        return std::nullopt;
    } else if (!found) {
      continue;
    }
    at = {from_level(u, k), from_level(v, k)};
  }
  return at;
}

}  // namespace patch_flow

}  // namespace fiducap
