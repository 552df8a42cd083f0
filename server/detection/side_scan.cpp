#include "detection/side_scan.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

constexpr double kStep_px = 0.25;
constexpr double kBalanceStep_px = 0.2;
constexpr double kLevelStep_px = 0.5;
// What the next modules pull goes by the square of what is missing; fitted to 4200 rendered scenes
// (walls darker than paper) and, for other walls, to squares whose pixels are means over their
// area. Lenses that are less sharp than a pixel pull up to twice as much.
constexpr double kLeastModule_px = 1.1;
constexpr double kPullOfBits = 0.0245;
constexpr double kPullOfWall = 0.0224;

/// A wall that is darker still ends the rise not that much earlier: |w|^0.75.
double ends_by(double of_wall) {
  return std::copysign(std::sqrt(std::abs(of_wall) * std::sqrt(std::abs(of_wall))), of_wall);
}

}  // namespace

std::optional<SideScan::Rise> SideScan::rise(const Eigen::Vector2d& px,
                                             const Eigen::Vector2d& outward, double most) const {
  double sum = 0;
  double squares = 0;
  double weight = 0;
  for (double t = -reach_px; t <= reach_px + 1e-9; t += kStep_px) {
    const Eigen::Vector2d outer = px + (t + gradient_px) * outward;
    const Eigen::Vector2d inner = px + (t - gradient_px) * outward;
    if (!holds(outer) || !holds(inner)) return std::nullopt;  // half of a rise is another place
    const double rise = std::min(gray(outer), most) - std::min(gray(inner), most);
    if (rise <= 0) continue;
    sum += rise * rise * t;
    squares += rise * rise * t * t;
    weight += rise * rise;
  }
  if (weight <= 0) return std::nullopt;
  const double mean = sum / weight;
  return Rise{mean, squares / weight - mean * mean};
}

double SideScan::pull_px(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                         double module_px) const {
  if (module_px >= kAlone_px) return 0;
  const Eigen::Vector2d module = module_px * outward;
  const Eigen::Vector2d bit = px - 1.5 * module;
  const Eigen::Vector2d wall = px + 1.5 * module;
  if (!holds(bit) || !holds(wall)) return 0;
  const double black = gray(px - 0.5 * module);
  const double white = gray(px + 0.5 * module);
  if (!(white > black)) return 0;
  const double of_bits = std::clamp((gray(bit) - black) / (white - black), 0.0, 1.0);
  const double of_wall = std::clamp((white - gray(wall)) / (white - black), -1.0, 1.0);
  const double missing_px = kAlone_px - std::max(kLeastModule_px, module_px);
  return missing_px * missing_px * (kPullOfBits * of_bits - kPullOfWall * ends_by(of_wall));
}

double SideScan::mean_gray(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                           double from_px, double to_px) const {
  const double width_px = to_px - from_px;
  const int steps = 1 + static_cast<int>(width_px / kLevelStep_px);
  double sum = 0;
  for (int j = 0; j < steps; ++j)
    sum += gray(px + (from_px + (j + 0.5) / steps * width_px) * outward);
  return sum / steps;
}

std::optional<double> SideScan::balance(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                                        double half_px, double plain_px) const {
  if (!holds(px - plain_px * outward) || !holds(px + plain_px * outward)) return std::nullopt;
  const double black = mean_gray(px, outward, -plain_px, -half_px);
  const double white = mean_gray(px, outward, half_px, plain_px);
  if (!(white > black)) return std::nullopt;
  const int steps = static_cast<int>(std::ceil(2 * half_px / kBalanceStep_px));
  double sum = 0;
  for (int j = 0; j < steps; ++j)
    sum += gray(px + (2 * (j + 0.5) / steps - 1) * half_px * outward) - black;
  return half_px * (1 - 2 * sum / (steps * (white - black)));
}

}  // namespace fiducap
