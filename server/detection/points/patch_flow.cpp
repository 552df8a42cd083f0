#include "detection/points/patch_flow.hpp"

#include <array>
#include <cmath>

namespace fiducap::patch_flow {

namespace {

constexpr int kRimmed = kSide + 2;  // with one more pixel around, for the gradients
constexpr int kArea = kSide * kSide;
constexpr int kMostSteps = 12;
constexpr float kArrived_px = 0.01F;
constexpr float kFarthest_px = 12.0F;  // from where a level begins: more is not what was looked for
// What may be left between both patches, RMS in grays: noise of both, and a little of their own
// contrast.
constexpr float kMostResidual = 8.0F;
constexpr float kResidualShare = 0.35F;

/// Grays of side × side pixels around (u, v), between pixels. @return false: reaches out of the
/// image
template <int kWide>
bool sample(const ImagePyramid::Level& level, float u, float v,
            std::array<float, kWide * kWide>& out) {
  const float left = u - static_cast<float>(kWide / 2);
  const float top = v - static_cast<float>(kWide / 2);
  if (!(left >= 0 && top >= 0)) return false;  // NaN too
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
    for (int k = 0; k < kWide; ++k) {
      to[k] = a * static_cast<float>(upper[k]) + b * static_cast<float>(upper[k + 1]) +
              c * static_cast<float>(lower[k]) + d * static_cast<float>(lower[k + 1]);
    }
  }
  return true;
}

/// The middle counts most: what the patch shows further out moves otherwise as soon as it turns or
/// comes nearer, and would drag the point along a little in every image. Sums to kArea.
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

/// What is looked for: grays and their gradients without mean, and the inverse of the gradients'
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

/// Moves (u, v) until the patch around it is the template's. @param residual  out: RMS of what is
/// left
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
    // Near the border, and where only the fine image has structure, the coarse levels have nothing
    // to say.
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

}  // namespace fiducap::patch_flow
