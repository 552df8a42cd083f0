#include "detection/side_fit.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "detection/tag_outline.hpp"

namespace fiducap {

namespace {

constexpr double kStep_px = 0.25;
constexpr double kPointEvery_px = 4.0;
constexpr int kFewestPoints = 16;
constexpr int kFewestSeen = 4;
// How far from the given side an edge is looked for, and over which distance its steepness is
// taken: shares of a module, so that the next module stays out of it.
constexpr double kReach = 0.6;
constexpr double kLeastReach_px = 1.0;
constexpr double kMostReach_px = 3.0;
constexpr double kGradient = 0.4;
constexpr double kLeastGradient_px = 0.5;
constexpr double kMostGradient_px = 1.0;
// A border narrower than this shares its pixels with what lies on both sides of it. The pull is
// that of a step between two modules, each pixel a mean over its area; below kNarrow_px it is not
// known.
constexpr double kAlone_px = 3.6;
constexpr double kNarrow_px = 1.5;
constexpr double kPull = 0.045;  // per px, times the square of what is missing

/// A line n·x = c.
struct Line {
  Eigen::Vector2d n;
  double c;
};

struct Scan {
  const GrayImage& image;
  double reach_px;
  double gradient_px;

  [[nodiscard]] bool holds(const Eigen::Vector2d& px) const {
    return px.x() >= 0 && px.y() >= 0 && px.x() < image.width - 1 && px.y() < image.height - 1;
  }

  /// Bilinear. @pre holds(px)
  [[nodiscard]] double gray(const Eigen::Vector2d& px) const {
    const int u = static_cast<int>(px.x());
    const int v = static_cast<int>(px.y());
    const double a = px.x() - u;
    const double b = px.y() - v;
    const std::uint8_t* p = image.pixels.data() +
                            static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) + u;
    return (1 - b) * ((1 - a) * p[0] + a * p[1]) +
           b * ((1 - a) * p[image.width] + a * p[image.width + 1]);
  }

  /// Where along `outward` from `px` gray rises most, weighted by the square of the rise. nullopt:
  /// nowhere.
  [[nodiscard]] std::optional<double> edge(const Eigen::Vector2d& px,
                                           const Eigen::Vector2d& outward) const {
    double sum = 0;
    double weight = 0;
    for (double t = -reach_px; t <= reach_px + 1e-9; t += kStep_px) {
      const Eigen::Vector2d outer = px + (t + gradient_px) * outward;
      const Eigen::Vector2d inner = px + (t - gradient_px) * outward;
      if (!holds(outer) || !holds(inner)) continue;
      const double rise = gray(outer) - gray(inner);
      if (rise <= 0) continue;
      sum += rise * rise * t;
      weight += rise * rise;
    }
    if (weight <= 0) return std::nullopt;
    return sum / weight;
  }

  /// How far the next modules pull the edge outwards: white bits inside of the border let the rise
  /// begin late, a dark wall beyond the quiet zone lets it end early.
  [[nodiscard]] double pull_px(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                               double module_px) const {
    if (module_px >= kAlone_px) return 0;
    const Eigen::Vector2d module = module_px * outward;
    const Eigen::Vector2d bit = px - 1.5 * module;
    const Eigen::Vector2d wall = px + 1.5 * module;
    if (!holds(bit) || !holds(wall)) return 0;
    const double black = gray(px - 0.5 * module);
    const double white = gray(px + 0.5 * module);
    if (!(white > black)) return 0;
    const double unlike = (gray(bit) - black) - (white - gray(wall));
    const double missing_px = kAlone_px - std::max(kNarrow_px, module_px);
    return kPull * missing_px * missing_px * std::clamp(unlike / (white - black), -1.0, 1.0);
  }
};

std::optional<Line> fit_side(const Scan& scan, const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                             const Eigen::Vector2d& middle, int modules) {
  const Eigen::Vector2d along = (b - a).normalized();
  Eigen::Vector2d outward(-along.y(), along.x());
  if (outward.dot(a - middle) < 0) outward = -outward;
  const double module_px = 2 * outward.dot(a - middle) / modules;
  const int points = std::max(kFewestPoints, static_cast<int>((b - a).norm() / kPointEvery_px));
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  int seen = 0;
  for (int k = 0; k < points; ++k) {
    const Eigen::Vector2d px = a + (k + 1.0) / (points + 1) * (b - a);
    const auto at = scan.edge(px, outward);
    if (!at) continue;
    const double pull_px = scan.pull_px(px, outward, module_px);
    const Eigen::Vector2d edge = px + (*at - pull_px) * outward - a;
    sum += edge;
    squares += edge * edge.transpose();
    ++seen;
  }
  if (seen < kFewestSeen) return std::nullopt;
  const Eigen::Vector2d mean = sum / seen;
  const Eigen::Matrix2d C = squares / seen - mean * mean.transpose();
  const double angle =
      0.5 * std::atan2(2 * C(0, 1), C(0, 0) - C(1, 1));  // direction of the longer axis
  const Eigen::Vector2d n(-std::sin(angle), std::cos(angle));
  return Line{n, n.dot(mean + a)};
}

}  // namespace

std::optional<std::array<Eigen::Vector2d, 4>> fit_sides(
    const GrayImage& image, const std::array<Eigen::Vector2d, 4>& corners_px, int modules) {
  const double module_px = outline_of(corners_px).width_px / modules;
  if (!(module_px > 0)) return std::nullopt;
  const Scan scan{image, std::clamp(kReach * module_px, kLeastReach_px, kMostReach_px),
                  std::clamp(kGradient * module_px, kLeastGradient_px, kMostGradient_px)};
  const Eigen::Vector2d middle =
      0.25 * (corners_px[0] + corners_px[1] + corners_px[2] + corners_px[3]);
  std::array<Line, 4> sides;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto side = fit_side(scan, corners_px[i], corners_px[(i + 1) % 4], middle, modules);
    if (!side) return std::nullopt;
    sides[i] = *side;
  }
  std::array<Eigen::Vector2d, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const Line& before = sides[(i + 3) % 4];
    const Line& after = sides[i];
    Eigen::Matrix2d N;
    N << before.n.transpose(), after.n.transpose();
    corners[i] = N.inverse() * Eigen::Vector2d(before.c, after.c);
    if (!((corners[i] - corners_px[i]).norm() < std::max(1.0, module_px)))
      return std::nullopt;  // NaN fails too
  }
  return corners;
}

}  // namespace fiducap
