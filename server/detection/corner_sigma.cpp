#include "detection/corner_sigma.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "detection/tag_outline.hpp"

namespace fiducap {

namespace {

constexpr int kPointsPerSide = 16;
// tag36h11; other families have wider modules.
constexpr double kModules = 8;
constexpr double kHalfModule = 1 / kModules;  // as a share of the way from the middle

// The fit, in pixels of this detector at any resolution.
constexpr double kFinest_px = 0.0166;  // a large tag seen from the front
constexpr double kSmall_px = 0.38;     // points along a side, pixels per module
constexpr double kTiltPower = 1.9;     // of the variance
constexpr double kNoise_px = 0.554;
// What `edge_sharpness` steps over.
constexpr double kStep_px = 2.0;
constexpr double kLeastSharpness = 0.1;
// Narrow modules: what lies beside them is smeared into them at once (side_fit does not take it
// out).
constexpr double kNarrow_px = 3.0;
constexpr double kNarrowSmear = 0.061;
// Others, from a part of a module on: what the fit of a smeared side leaves, and what noise does to
// it, which grows with the pixels to tell grays apart over.
constexpr double kSmear_px = 0.1135;
constexpr double kSmearNoise = 0.488;
constexpr double kSmearEdge_px = 0.29;
constexpr double kSmearPart = 0.38;
constexpr double kSmearTiltPower = 1.25;

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

/// What a side smeared over some pixels is off more than a sharp one, px².
/// @param noise  as a share of the contrast
double smear_variance(double sharpness, double module_px, double tilt, double noise) {
  const double share = std::max(sharpness, kLeastSharpness);
  const double smear_px = kStep_px * std::sqrt(std::max(0.0, 1 / square(share) - 1));
  if (module_px < kNarrow_px) return square(std::max(0.0, kNarrowSmear * smear_px));
  const double reaches = std::max(0.0, (smear_px + kSmearEdge_px) / module_px - kSmearPart);
  return (square(kSmear_px) + square(kSmearNoise * noise * module_px)) * square(reaches) *
         std::pow(tilt, kSmearTiltPower);
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
  const double tilt = outline.longest_px / outline.width_px;
  const double shape =
      (square(kFinest_px) + square(kSmall_px / outline.width_px)) * std::pow(tilt, kTiltPower);
  const double noise = tag.decision_margin > 0 ? pixel_noise / tag.decision_margin : 0.0;
  const double smear = smear_variance(tag.sharpness, outline.width_px / kModules, tilt, noise);
  return std::sqrt(shape + smear + square(kNoise_px * noise));
}

}  // namespace fiducap
