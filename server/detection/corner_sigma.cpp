#include "detection/corner_sigma.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr int kPointsPerSide = 16;
constexpr double kClipped = 250;
// Cells above this are wide: nothing beyond the quiet zone reaches the side. A saturated wall has
// its full influence below kNoQuietZone_px.
constexpr double kWide_px = 3.6;
constexpr double kNoQuietZone_px = 1.5;
constexpr double kMinCell_px = 0.5;  // smaller ones are not decoded

// Fitted constants, in pixels of this detector at any resolution; powers are of variances.
/// Error of a sharp side by the grid of pixels, per method of side_fit.
struct SharpSide {
  double finest_px;  ///< Of a large tag seen from the front.
  double small_px;   ///< Times cells per pixel, across the side.
  double small_power;
  double tilt_power;
  double soft_power;  ///< Of sharpness: a soft edge covers more pixels.
};
constexpr SharpSide kBySteepest{0.0085, 0.09, 2.44, 1.12, 1.5};
constexpr SharpSide kByBalance{0.0066, 0.38, 4.57, 0.785, 0};
// Sides along the grid that are sharper than this are located by balance.
constexpr double kAlongGrid_px = 2.0;
constexpr double kBalanced_px = 1.8;
constexpr double kSharp = 0.9;
constexpr double kNoise_px = 3.5;  // at a side of one pixel
constexpr double kNoisePower = -2.06;
constexpr double kEndCorrelation = -0.6;  // of both ends of a line fitted to white noise
// Narrow cells along the grid of pixels: error and its scale in rows or columns crossed by the
// side. In full below kGridFull_px, none above kGridNone_px.
constexpr double kGridShift_px = 0.066;
constexpr double kShiftCrossed_px = 0.8;
constexpr double kGridTurn_px = 0.0875;
constexpr double kTurnCrossed_px = 0.6;
constexpr double kGridFull_px = 1.5;
constexpr double kGridNone_px = 3.0;
constexpr double kStep_px = 2.0;  // of measure_sides
constexpr double kMinSharpness = 0.1;
// Narrow cells: any blur mixes their neighbours into them (side_fit does not correct it): inwards,
// and the same in the next image.
constexpr double kNarrow_px = 3.0;
constexpr double kNarrowBlur = 0.1;
constexpr double kNoiseBlur_px2 = 0.25;  // apparent blur caused by noise
/// Wide cells: error of a blurred side, without noise and by noise, which grows with the width of a
/// cell. The errors of both ends are independent.
struct BlurSigma {
  double residual_px;
  double noise;  ///< Times cell and noise.
  double edge_px;
  double reach_power;  ///< Of blur relative to the cell.
  double shift_of_tilt, turn_of_tilt;
};
// Located by steepest points, or, from kModelledFrom cells of blur on, by find_blurred_edge.
constexpr BlurSigma kLittleBlur{0.0482, 0.173, 0.553, 5.59, 5.8, 13.6};
constexpr BlurSigma kModelled{0.0695, 0.074, 0.0, 2.30, 7.5, 11.7};
constexpr double kModelledFrom = 0.7;
// Bias of a narrow side by a lens less sharp than a pixel or by motion: in full below
// kNarrowest_px, none above kUnbiased_px.
constexpr double kLastingShift_px = 0.05;
constexpr double kNarrowest_px = 2.2;
constexpr double kUnbiased_px = 3.2;
// Saturated white spreads into the black, at all overexposures up to eight times.
constexpr double kClippedShift_px = 0.36;
constexpr double kClippedTurn_px = 0.08;
// Sigma of a blurred side without a fit: one in some thousands, up to three pixels off.
constexpr double kUnfitted_px = 1.0;

double square(double x) { return x * x; }

std::optional<double> gray_at(const GrayImage& image, const Eigen::Vector2d& px) {
  const long u = std::lround(px.x());
  const long v = std::lround(px.y());
  if (u < 0 || v < 0 || u >= image.width || v >= image.height) return std::nullopt;
  return image.pixels[static_cast<std::size_t>(v * image.width + u)];
}

/// Sums of differences over the points of one side.
struct Step {
  double across{};     ///< Over two pixels.
  double total{};      ///< From the middle of the border to the middle of the quiet zone.
  int clipped{};       ///< Points with a saturated quiet zone.
  int wall_clipped{};  ///< Points with a saturated wall beyond it.
  int points{};
};

/// @param half_cell  outwards into the white, relative to the distance from the tag's middle;
///                   negative where white is inside
Step step_over(const GrayImage& image, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
               const Eigen::Vector2d& middle, double half_cell) {
  Step step;
  const Eigen::Vector2d along = (to - from).normalized();
  const Eigen::Vector2d normal(-along.y(), along.x());
  for (int k = 0; k < kPointsPerSide; ++k) {
    const double share = (k + 1.0) / (kPointsPerSide + 1);
    const Eigen::Vector2d px = (1 - share) * from + share * to;
    const auto one = gray_at(image, px + normal);
    const auto other = gray_at(image, px - normal);
    const auto white = gray_at(image, px + half_cell * (px - middle));
    const auto black = gray_at(image, px - half_cell * (px - middle));
    if (!one || !other || !white || !black) continue;
    step.across += std::abs(*one - *other);
    step.total += *white - *black;
    step.clipped += *white >= kClipped ? 1 : 0;
    const auto wall = gray_at(image, px + 3 * half_cell * (px - middle));
    step.wall_clipped += wall && *wall >= kClipped ? 1 : 0;
    ++step.points;
  }
  return step;
}

/// Width of a cell across side i.
double cell_across(const TagCorners& px, std::size_t i, int cells) {
  const Eigen::Vector2d along = px[(i + 1) % 4] - px[i];
  const Eigen::Vector2d inwards = centre_of(px) - px[i];
  const double length_px = std::max(1.0, along.norm());
  return 2 * std::abs(along.x() * inwards.y() - along.y() * inwards.x()) / length_px / cells;
}

/// Share of a wall's light that crosses the quiet zone, 0 … 1.
double wall_influence(double cell_px) {
  return std::clamp((kWide_px - cell_px) / (kWide_px - kNoQuietZone_px), 0.0, 1.0);
}

/// Quantities that determine the sigmas of a side.
struct SideMeasures {
  double length_px;
  double cell_px;     ///< Across it.
  double tilt;        ///< Longest side over width of the tag.
  double crossed_px;  ///< Rows or columns of pixels that it crosses, the smaller number.
  double noise;       ///< Relative to the contrast.
};

struct SideVariance {
  double shift, turn;
};

/// Variance that blur adds to a sharp side, px².
SideVariance blur_variance(const SideMeasures& side, double sharpness) {
  const double blur_px2 = square(kStep_px) * std::max(0.0, 1 / square(sharpness) - 1);
  if (side.cell_px < kNarrow_px) {
    const double both = 0.5 * square(kNarrowBlur) * std::max(0.0, blur_px2 - kNoiseBlur_px2);
    return {both, both};
  }
  const double blur_px = std::sqrt(blur_px2);
  const BlurSigma& by = blur_px < kModelledFrom * side.cell_px ? kLittleBlur : kModelled;
  const double both = 0.5 *
                      (square(by.residual_px) + square(by.noise * side.noise * side.cell_px)) *
                      std::pow((blur_px + by.edge_px) / side.cell_px, by.reach_power);
  const double tilt = side.tilt - 1;
  return {both * (1 + by.shift_of_tilt * tilt), both * (1 + by.turn_of_tilt * tilt)};
}

/// Variance by grid and noise of the pixels, at each end, px².
double white_variance(const SideMeasures& side, double sharpness) {
  const bool is_balanced =
      side.crossed_px < kAlongGrid_px && side.cell_px >= kBalanced_px && sharpness >= kSharp;
  const SharpSide& by = is_balanced ? kByBalance : kBySteepest;
  return (square(by.finest_px) + std::pow(by.small_px / side.cell_px, by.small_power)) *
             std::pow(side.tilt, by.tilt_power) * std::pow(sharpness, by.soft_power) +
         square(kNoise_px * side.noise) / side.length_px * std::pow(sharpness, kNoisePower);
}

/// Variance of narrow cells along the grid of pixels, px²: a shift of the side, or, where it
/// crosses one row, a turn.
SideVariance grid_variance(const SideMeasures& side) {
  const double narrow =
      std::clamp((kGridNone_px - side.cell_px) / (kGridNone_px - kGridFull_px), 0.0, 1.0);
  const double shift = kGridShift_px * std::exp(-square(side.crossed_px / kShiftCrossed_px));
  const double turn =
      kGridTurn_px * std::exp(-square(side.crossed_px - kTurnCrossed_px) / kTurnCrossed_px);
  return {square(narrow * shift), square(narrow * turn)};
}

SideSigma sigma_of(const SideMeasures& side, double measured_sharpness, double clipped_share) {
  const double sharpness = std::max(measured_sharpness, kMinSharpness);
  const double white = white_variance(side, sharpness);
  const SideVariance blur = blur_variance(side, sharpness);
  const SideVariance grid = grid_variance(side);
  const double clipped = square(clipped_share);
  return {std::sqrt(0.5 * (1 + kEndCorrelation) * white + blur.shift + grid.shift +
                    square(kClippedShift_px * clipped)),
          std::sqrt(0.5 * (1 - kEndCorrelation) * white + blur.turn + grid.turn +
                    square(kClippedTurn_px * clipped))};
}

}  // namespace

std::array<TagSide, 4> measure_sides(const GrayImage& image, const TagCorners& corners_px,
                                     int cells, bool is_white_inside) {
  const double half_cell = (is_white_inside ? -1.0 : 1.0) / cells;
  const Eigen::Vector2d middle = centre_of(corners_px);
  std::array<Step, 4> steps;
  double total = 0;
  int points = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    steps[i] = step_over(image, corners_px[i], corners_px[(i + 1) % 4], middle, half_cell);
    if (steps[i].points == 0) return {};
    total += steps[i].total;
    points += steps[i].points;
  }
  const double contrast = total / points;
  if (!(contrast > 0)) return {};
  std::array<TagSide, 4> out;
  for (std::size_t i = 0; i < 4; ++i) {
    out[i].sharpness = std::min(1.0, steps[i].across / steps[i].points / contrast);
    const double glare = wall_influence(cell_across(corners_px, i, cells)) *
                         static_cast<double>(steps[i].wall_clipped) / steps[i].points;
    out[i].clipped = std::max(static_cast<double>(steps[i].clipped) / steps[i].points, glare);
  }
  return out;
}

double least_sharpness(const std::array<TagSide, 4>& sides) {
  return std::min({sides[0].sharpness, sides[1].sharpness, sides[2].sharpness, sides[3].sharpness});
}

std::array<SideSigma, 4> side_sigmas(const TagSighting& tag, double pixel_noise, int cells) {
  const TagOutline outline = outline_of(tag.corners_px);
  if (!(tag.sharpness > 0) || !(outline.width_px > 0)) return {};
  const auto& px = tag.corners_px;
  SideMeasures side{};
  side.tilt = outline.longest_px / outline.width_px;
  side.noise = tag.decision_margin > 0 ? pixel_noise / tag.decision_margin : 0.0;
  // Some sources know only the tag's sharpness.
  const bool any_measured =
      std::ranges::any_of(tag.sides, [](const TagSide& seen) { return seen.sharpness > 0; });
  std::array<SideSigma, 4> out;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d along = (px[(i + 1) % 4] - px[i]).cwiseAbs();
    side.length_px = std::max(1.0, along.norm());
    side.crossed_px = along.minCoeff();
    side.cell_px = std::max(kMinCell_px, cell_across(px, i, cells));
    const TagSide& seen = tag.sides[i];
    const bool is_measured = seen.sharpness > 0;
    out[i] = sigma_of(side, is_measured ? seen.sharpness : tag.sharpness, seen.clipped);
    if (!is_measured && any_measured) out[i] = {kUnfitted_px, kUnfitted_px};
  }
  return out;
}

std::array<SideSigma, 4> with_lasting_error(std::array<SideSigma, 4> sides,
                                            const TagCorners& corners_px, int cells) {
  for (std::size_t i = 0; i < 4; ++i) {
    if (!(sides[i].shift_px > 0)) continue;
    const double cell_px = cell_across(corners_px, i, cells);
    const double narrow =
        std::clamp((kUnbiased_px - cell_px) / (kUnbiased_px - kNarrowest_px), 0.0, 1.0);
    sides[i].shift_px = std::hypot(sides[i].shift_px, kLastingShift_px * narrow);
  }
  return sides;
}

double corner_sigma_px(const TagCorners& corners_px, const std::array<SideSigma, 4>& sides) {
  return std::sqrt(corner_covariance(corners_px, sides).trace() / 8);
}

}  // namespace fiducap
