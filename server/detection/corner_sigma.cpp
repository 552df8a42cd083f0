#include "detection/corner_sigma.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "detection/tag_outline.hpp"

namespace fiducap {

namespace {

constexpr int kPointsPerSide = 16;
// Half a module of tag36h11; other families have wider ones.
constexpr double kHalfModule = 0.125;

// The fit, in pixels of this detector at any resolution.
constexpr double kFinest_px = 0.0148;  // a large tag seen from the front
constexpr double kSmall_px = 0.722;    // points along a side, pixels per module
constexpr double kSmallPower = 2.03;   // of the variance, like the next two
constexpr double kTiltPower = 1.36;
constexpr double kSmear_px = 0.248;
constexpr double kSmearWidth_px = 16.0;
constexpr double kSmearPower = 2.36;
constexpr double kLeastSharpness = 0.1;
// Smeared over more than about a module, a side runs into the bits beside it.
constexpr double kModuleSmear = 0.52;
constexpr double kOverlap_px = 1.25;
constexpr double kNoise_px = 0.573;

double square(double x) { return x * x; }

std::optional<double> gray_at(const GrayImage& image, const Eigen::Vector2d& px) {
  const long u = std::lround(px.x());
  const long v = std::lround(px.y());
  if (u < 0 || v < 0 || u >= image.width || v >= image.height) return std::nullopt;
  return image.pixels[static_cast<std::size_t>(v * image.width + u)];
}

/// Sums of differences over the points of one side.
struct Step {
  double across{};  ///< Over two pixels.
  double total{};   ///< From the middle of the border to the middle of the quiet zone.
  int points{};
};

Step step_over(const GrayImage& image, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
               const Eigen::Vector2d& middle) {
  Step step;
  const Eigen::Vector2d along = (to - from).normalized();
  const Eigen::Vector2d normal(-along.y(), along.x());
  for (int k = 0; k < kPointsPerSide; ++k) {
    const double share = (k + 1.0) / (kPointsPerSide + 1);
    const Eigen::Vector2d px = (1 - share) * from + share * to;
    const auto one = gray_at(image, px + normal);
    const auto other = gray_at(image, px - normal);
    const auto white = gray_at(image, px + kHalfModule * (px - middle));
    const auto black = gray_at(image, px - kHalfModule * (px - middle));
    if (!one || !other || !white || !black) continue;
    step.across += std::abs(*one - *other);
    step.total += *white - *black;
    ++step.points;
  }
  return step;
}

}  // namespace

double edge_sharpness(const GrayImage& image, const std::array<Eigen::Vector2d, 4>& corners_px) {
  const Eigen::Vector2d middle =
      0.25 * (corners_px[0] + corners_px[1] + corners_px[2] + corners_px[3]);
  double least = 1e9;
  double total = 0;
  int points = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Step step = step_over(image, corners_px[i], corners_px[(i + 1) % 4], middle);
    if (step.points == 0) return 0;
    least = std::min(least, step.across / step.points);
    total += step.total;
    points += step.points;
  }
  const double contrast = total / points;
  return contrast > 0 ? std::min(1.0, least / contrast) : 0.0;
}

double corner_sigma_px(const TagSighting& tag, double pixel_noise) {
  if (!(tag.sharpness > 0)) return 0;
  const TagOutline outline = outline_of(tag.corners_px);
  if (!(outline.width_px > 0)) return 0;
  const double shape = (square(kFinest_px) + std::pow(kSmall_px / outline.width_px, kSmallPower)) *
                       std::pow(outline.longest_px / outline.width_px, kTiltPower);
  const double smear =
      (1 / std::max(tag.sharpness, kLeastSharpness) - 1) * kSmearWidth_px / outline.width_px;
  const double blur = square(kSmear_px) * std::pow(smear, kSmearPower) +
                      square(kOverlap_px * std::max(0.0, smear - kModuleSmear));
  const double noise =
      tag.decision_margin > 0 ? square(kNoise_px * pixel_noise / tag.decision_margin) : 0.0;
  return std::sqrt(shape + blur + noise);
}

}  // namespace fiducap
