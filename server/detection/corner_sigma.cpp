#include "detection/corner_sigma.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "detection/corner_covariance.hpp"
#include "detection/tag_outline.hpp"

namespace fiducap {

namespace {

constexpr int kPointsPerSide = 16;
constexpr double kClipped = 250;
// Modules above this are wide: nothing beyond the quiet zone reaches the side. A wall at the
// sensor's end does all of it below kBareQuiet_px.
constexpr double kWide_px = 3.6;
constexpr double kBareQuiet_px = 1.5;
constexpr double kLeastModule_px = 0.5;  // smaller ones are not decoded

// The fit, in pixels of this detector at any resolution; powers are of variances.
/// What the grid of pixels leaves of a sharp side, by how side_fit finds it.
struct SharpSide {
  double finest_px;  ///< A large tag seen from the front.
  double small_px;   ///< Times modules per pixel, across the side.
  double small_power;
  double tilt_power;
  double soft_power;  ///< Of sharpness: a soft edge is drawn by more pixels.
};
constexpr SharpSide kBySteepest{0.0085, 0.09, 2.44, 1.12, 1.5};
constexpr SharpSide kByBalance{0.0066, 0.38, 4.57, 0.785, 0};
// Sides along the grid that are so sharp are found by balance.
constexpr double kAlongGrid_px = 2.0;
constexpr double kBalanced_px = 1.8;
constexpr double kSharp = 0.9;
constexpr double kNoise_px = 3.5;  // at a side of one pixel
constexpr double kNoisePower = -2.06;
constexpr double kEndsAlike = -0.6;  // correlation of both ends: a line fitted to white noise
// Narrow modules along the grid of pixels: rows or columns that the side crosses, at the scale of
// which it is shifted, or turned. All of it at kDrawn_px, none from kNotDrawn_px on.
constexpr double kDrawnShift_px = 0.066;
constexpr double kShiftCrossed_px = 0.8;
constexpr double kDrawnTurn_px = 0.0875;
constexpr double kTurnCrossed_px = 0.6;
constexpr double kDrawn_px = 1.5;
constexpr double kNotDrawn_px = 3.0;
// What `look_at_sides` steps over.
constexpr double kStep_px = 2.0;
constexpr double kLeastSharpness = 0.1;
// Narrow modules: what lies beside them is smeared into them at once (side_fit does not take it
// out): inwards, and the same in the next image.
constexpr double kNarrow_px = 3.0;
constexpr double kNarrowSmear = 0.1;
constexpr double kNoSmear_px2 = 0.25;  // noise looks like so much
/// Others: what smear leaves of a side, and what noise does to it, which grows with the pixels to
/// tell grays apart over. Both ends for themselves.
struct SmearedSide {
  double left_px;
  double noise;  ///< Times module and noise.
  double edge_px;
  double reach_power;  ///< Of smear by module.
  double shift_of_tilt, turn_of_tilt;
};
// By its steepest place, or told apart into grays (smeared_side), from there on.
constexpr SmearedSide kLittleSmear{0.0482, 0.173, 0.553, 5.59, 5.8, 13.6};
constexpr SmearedSide kToldApart{0.0695, 0.074, 0.0, 2.30, 7.5, 11.7};
constexpr double kToldApartFrom = 0.7;
// What a lens less sharp than a pixel, or some motion, pulls a narrow side: all of it below
// kNarrowest_px, none of it above kUnpulled_px.
constexpr double kLastingShift_px = 0.05;
constexpr double kNarrowest_px = 2.2;
constexpr double kUnpulled_px = 3.2;
// White at the sensor's end: what is brighter than it can say spreads into the black, however much
// brighter it is (up to eight times).
constexpr double kClippedShift_px = 0.36;
constexpr double kClippedTurn_px = 0.08;
// A smeared side that could not be told apart: one in some thousands, up to three pixels off.
constexpr double kGuessed_px = 1.0;

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
  int clipped{};    ///< Points whose quiet zone is at the sensor's end …
  int glaring{};    ///< … or the wall beyond.
  int points{};
};

/// @param half_module  outwards into the white, as a share of the way from the middle; negative
///                     where that is inside
Step step_over(const GrayImage& image, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
               const Eigen::Vector2d& middle, double half_module) {
  Step step;
  const Eigen::Vector2d along = (to - from).normalized();
  const Eigen::Vector2d normal(-along.y(), along.x());
  for (int k = 0; k < kPointsPerSide; ++k) {
    const double share = (k + 1.0) / (kPointsPerSide + 1);
    const Eigen::Vector2d px = (1 - share) * from + share * to;
    const auto one = gray_at(image, px + normal);
    const auto other = gray_at(image, px - normal);
    const auto white = gray_at(image, px + half_module * (px - middle));
    const auto black = gray_at(image, px - half_module * (px - middle));
    if (!one || !other || !white || !black) continue;
    step.across += std::abs(*one - *other);
    step.total += *white - *black;
    step.clipped += *white >= kClipped ? 1 : 0;
    const auto wall = gray_at(image, px + 3 * half_module * (px - middle));
    step.glaring += wall && *wall >= kClipped ? 1 : 0;
    ++step.points;
  }
  return step;
}

/// Of the side from corner i on.
double module_across(const std::array<Eigen::Vector2d, 4>& px, std::size_t i, int modules) {
  const Eigen::Vector2d along = px[(i + 1) % 4] - px[i];
  const Eigen::Vector2d inwards = 0.25 * (px[0] + px[1] + px[2] + px[3]) - px[i];
  const double length_px = std::max(1.0, along.norm());
  return 2 * std::abs(along.x() * inwards.y() - along.y() * inwards.x()) / length_px / modules;
}

/// How much of a wall's light gets across a quiet zone, 0 … 1.
double reach_of_wall(double module_px) {
  return std::clamp((kWide_px - module_px) / (kWide_px - kBareQuiet_px), 0.0, 1.0);
}

/// What one side is measured by.
struct Side {
  double length_px;
  double module_px;   ///< Across it.
  double tilt;        ///< Of the tag.
  double crossed_px;  ///< Rows or columns of pixels, whichever are fewer.
  double noise;       ///< As a share of the contrast.
};

struct SideVariance {
  double shift, turn;
};

/// What a side smeared over some pixels is off more than a sharp one, px².
SideVariance smear_variance(const Side& side, double sharpness) {
  const double smear_px2 = square(kStep_px) * std::max(0.0, 1 / square(sharpness) - 1);
  if (side.module_px < kNarrow_px) {
    const double both = 0.5 * square(kNarrowSmear) * std::max(0.0, smear_px2 - kNoSmear_px2);
    return {both, both};
  }
  const double smear_px = std::sqrt(smear_px2);
  const SmearedSide& by = smear_px < kToldApartFrom * side.module_px ? kLittleSmear : kToldApart;
  const double both = 0.5 * (square(by.left_px) + square(by.noise * side.noise * side.module_px)) *
                      std::pow((smear_px + by.edge_px) / side.module_px, by.reach_power);
  const double tilt = side.tilt - 1;
  return {both * (1 + by.shift_of_tilt * tilt), both * (1 + by.turn_of_tilt * tilt)};
}

/// What grid and noise of the pixels do, at each end, px².
double white_variance(const Side& side, double sharpness) {
  const bool is_balanced =
      side.crossed_px < kAlongGrid_px && side.module_px >= kBalanced_px && sharpness >= kSharp;
  const SharpSide& by = is_balanced ? kByBalance : kBySteepest;
  return (square(by.finest_px) + std::pow(by.small_px / side.module_px, by.small_power)) *
             std::pow(side.tilt, by.tilt_power) * std::pow(sharpness, by.soft_power) +
         square(kNoise_px * side.noise) / side.length_px * std::pow(sharpness, kNoisePower);
}

/// What the grid of pixels does to narrow modules along it: the same all along the side, or, where
/// it crosses one row, turning it.
SideVariance grid_variance(const Side& side) {
  const double narrow =
      std::clamp((kNotDrawn_px - side.module_px) / (kNotDrawn_px - kDrawn_px), 0.0, 1.0);
  const double shift = kDrawnShift_px * std::exp(-square(side.crossed_px / kShiftCrossed_px));
  const double turn =
      kDrawnTurn_px * std::exp(-square(side.crossed_px - kTurnCrossed_px) / kTurnCrossed_px);
  return {square(narrow * shift), square(narrow * turn)};
}

SideSigma sigma_of(const Side& side, double measured_sharpness, double clipped_share) {
  const double sharpness = std::max(measured_sharpness, kLeastSharpness);
  const double white = white_variance(side, sharpness);
  const SideVariance smear = smear_variance(side, sharpness);
  const SideVariance grid = grid_variance(side);
  const double clipped = square(clipped_share);
  return {std::sqrt(0.5 * (1 + kEndsAlike) * white + smear.shift + grid.shift +
                    square(kClippedShift_px * clipped)),
          std::sqrt(0.5 * (1 - kEndsAlike) * white + smear.turn + grid.turn +
                    square(kClippedTurn_px * clipped))};
}

}  // namespace

std::array<TagSide, 4> look_at_sides(const GrayImage& image,
                                     const std::array<Eigen::Vector2d, 4>& corners_px, int modules,
                                     bool is_white_inside) {
  const double half_module = (is_white_inside ? -1.0 : 1.0) / modules;
  const Eigen::Vector2d middle =
      0.25 * (corners_px[0] + corners_px[1] + corners_px[2] + corners_px[3]);
  std::array<Step, 4> steps;
  double total = 0;
  int points = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    steps[i] = step_over(image, corners_px[i], corners_px[(i + 1) % 4], middle, half_module);
    if (steps[i].points == 0) return {};
    total += steps[i].total;
    points += steps[i].points;
  }
  const double contrast = total / points;
  if (!(contrast > 0)) return {};
  std::array<TagSide, 4> out;
  for (std::size_t i = 0; i < 4; ++i) {
    out[i].sharpness = std::min(1.0, steps[i].across / steps[i].points / contrast);
    const double glare = reach_of_wall(module_across(corners_px, i, modules)) *
                         static_cast<double>(steps[i].glaring) / steps[i].points;
    out[i].clipped = std::max(static_cast<double>(steps[i].clipped) / steps[i].points, glare);
  }
  return out;
}

double least_sharpness(const std::array<TagSide, 4>& sides) {
  return std::min({sides[0].sharpness, sides[1].sharpness, sides[2].sharpness, sides[3].sharpness});
}

std::array<SideSigma, 4> side_sigmas(const TagSighting& tag, double pixel_noise, int modules) {
  const TagOutline outline = outline_of(tag.corners_px);
  if (!(tag.sharpness > 0) || !(outline.width_px > 0)) return {};
  const auto& px = tag.corners_px;
  Side side{};
  side.tilt = outline.longest_px / outline.width_px;
  side.noise = tag.decision_margin > 0 ? pixel_noise / tag.decision_margin : 0.0;
  // A source may know no more than the tag's own.
  const bool are_told = std::any_of(tag.sides.begin(), tag.sides.end(),
                                    [](const TagSide& seen) { return seen.sharpness > 0; });
  std::array<SideSigma, 4> out;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d along = (px[(i + 1) % 4] - px[i]).cwiseAbs();
    side.length_px = std::max(1.0, along.norm());
    side.crossed_px = along.minCoeff();
    side.module_px = std::max(kLeastModule_px, module_across(px, i, modules));
    const TagSide& seen = tag.sides[i];
    const bool is_told = seen.sharpness > 0;
    out[i] = sigma_of(side, is_told ? seen.sharpness : tag.sharpness, seen.clipped);
    if (!is_told && are_told) out[i] = {kGuessed_px, kGuessed_px};
  }
  return out;
}

std::array<SideSigma, 4> with_what_lasts(std::array<SideSigma, 4> sides,
                                         const std::array<Eigen::Vector2d, 4>& corners_px,
                                         int modules) {
  for (std::size_t i = 0; i < 4; ++i) {
    if (!(sides[i].shift_px > 0)) continue;
    const double module_px = module_across(corners_px, i, modules);
    const double narrow =
        std::clamp((kUnpulled_px - module_px) / (kUnpulled_px - kNarrowest_px), 0.0, 1.0);
    sides[i].shift_px = std::hypot(sides[i].shift_px, kLastingShift_px * narrow);
  }
  return sides;
}

double corner_sigma_px(const std::array<Eigen::Vector2d, 4>& corners_px,
                       const std::array<SideSigma, 4>& sides) {
  return std::sqrt(corner_covariance(corners_px, sides).trace() / 8);
}

}  // namespace fiducap
