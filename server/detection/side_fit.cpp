#include "detection/side_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "detection/side_scan.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr double kPointSpacing_px = 1.3;
constexpr int kMinScanPoints = 16;
constexpr int kMaxPoints = 80;
constexpr double kSkippedEnd_px = 3.5;
constexpr double kMaxSkippedEnd = 0.12;
// Of the contrast: noise and uneven light brighten paper above its mean.
constexpr double kPaperTolerance = 0.05;
// Search range around the given side and distance of the gradient: shares of a cell, so that the
// next cell does not contribute.
constexpr double kReach = 0.6;
constexpr double kMinReach_px = 1.0;
constexpr double kMaxReach_px = 3.0;
constexpr double kGradient = 0.4;
constexpr double kMinGradient_px = 0.5;
constexpr double kMaxGradient_px = 1.0;
// Sides located by the sum of their gray (SideScan::balance): sharp ones with narrow cells from
// this width on, or crossing fewer rows or columns of pixels. Half width of the sum, and limit of
// uniform black and white.
constexpr double kBalanced_px = 1.8;
constexpr double kMaxCrossed_px = 2.0;
constexpr double kMaxHalf_px = 1.5;
constexpr double kMaxUniform_px = kSkippedEnd_px;
constexpr double kMaxSharpSpread_px = 0.7;  // RMS of the rise; 0.57 where nothing moves
constexpr double kNarrowSharp_px = 0.9;
constexpr double kMaxOff_px = 1.2;
// A rise of gray over more than this share of a cell, RMS, is motion blur. Narrow borders do not
// show it.
constexpr double kBlurredSpread = 0.2;
constexpr double kBlurredFrom_px = 3.0;
// Above this spread wide cells are scanned again with a larger reach.
constexpr double kWideScanSpread_px = 1.35;
// A side found further than this from its start is searched again from there.
constexpr double kRepeatBeyond_px = 0.5;
constexpr int kMaxRepeats = 4;
constexpr double kWellPlaced = 0.2;  // cells; of a blurred side
// Black and white are measured away from the ends of a side, which blur along it reaches.
constexpr double kLevelsMargin = 0.25;
constexpr double kMaxBlurOfLevels = 0.8;
// Largest correction of a corner, in cells: in blur the detector is up to one cell off.
constexpr double kMaxMoved = 1.5;
constexpr int kProfiles = 12;          // along half a side
constexpr double kCornerShare = 0.06;  // of a side, at both ends: the neighbour is blurred into it

/// A fitted side.
struct Side {
  Line line;
  double spread_px;  ///< Of the rise of gray, RMS.
};

/// Part of a side, as shares of its length.
struct Stretch {
  double from{0};
  double to{1};
};

/// One side of the tag, as assumed by the search.
struct SideGeometry {
  Eigen::Vector2d a, b;
  Eigen::Vector2d outward;
  double cell_px;
  double min_cell_px;  ///< Smallest cell across it: of a far side, at its far end.
  /// Displacement of the neighbouring side along this one, per pixel inwards, at either end; 0:
  /// away from this side.
  double lean_a, lean_b;

  SideGeometry(const TagCorners& corners_px, std::size_t i, int cells)
      : a(corners_px[i]), b(corners_px[(i + 1) % 4]) {
    const Eigen::Vector2d middle = centre_of(corners_px);
    const Eigen::Vector2d along = (b - a).normalized();
    outward = {-along.y(), along.x()};
    if (outward.dot(a - middle) < 0) outward = -outward;
    cell_px = 2 * outward.dot(a - middle) / cells;
    const Eigen::Vector2d& behind_b = corners_px[(i + 2) % 4];
    const Eigen::Vector2d& behind_a = corners_px[(i + 3) % 4];
    const double across_px = std::min(outward.dot(a - behind_a), outward.dot(b - behind_b));
    min_cell_px = across_px / cells * std::min(1.0, (b - a).norm() / (behind_b - behind_a).norm());
    lean_a = std::max(0.0, along.dot(behind_a - a) / outward.dot(a - behind_a));
    lean_b = std::max(0.0, along.dot(b - behind_b) / outward.dot(b - behind_b));
  }

  [[nodiscard]] bool is_blurred(const Side& side) const {
    return !(side.spread_px < kBlurredSpread * cell_px || cell_px < kBlurredFrom_px);
  }

  /// Length of the blur in cells; limited by the reach of the scan.
  [[nodiscard]] double blur_of_side(const Side& side) const {
    return std::sqrt(12.0) * side.spread_px / cell_px;
  }

  /// Moves both ends onto the line. @return the larger step
  double move_to(const Line& line) {
    const Eigen::Vector2d step_a = (line.c - line.n.dot(a)) * line.n;
    const Eigen::Vector2d step_b = (line.c - line.n.dot(b)) * line.n;
    a += step_a;
    b += step_b;
    return std::max(step_a.norm(), step_b.norm());
  }
};

/// Upper limit of the quiet zone's gray beside a side where the wall beyond is brighter: a sunlit
/// wall around a print in the shade is another step, one cell further out.
double max_paper_gray(const SideScan& scan, const SideGeometry& edge) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  double wall = 0;
  double white = 0;
  double black = 0;
  int points = 0;
  for (int k = 0; k < kMinScanPoints; ++k) {
    const Eigen::Vector2d px = edge.a + (k + 1.0) / (kMinScanPoints + 1) * (edge.b - edge.a);
    const Eigen::Vector2d outer = px + 0.5 * edge.cell_px * edge.outward;
    const Eigen::Vector2d inner = px - 0.5 * edge.cell_px * edge.outward;
    const Eigen::Vector2d beyond = px + 1.5 * edge.cell_px * edge.outward;
    if (!scan.holds(inner) || !scan.holds(beyond)) continue;
    wall += scan.gray(beyond);
    white += scan.gray(outer);
    black += scan.gray(inner);
    ++points;
  }
  const double limit = white + kPaperTolerance * (white - black);
  return points > 0 && wall > limit ? limit / points : kNone;
}

/// Calls `visit` with points along a side, about a pixel apart, without its ends.
template <class Visit>
void for_each_point(const SideGeometry& edge, const Stretch& stretch, Visit visit) {
  const Eigen::Vector2d along = edge.b - edge.a;
  const double length_px = along.norm();
  const int points =
      std::clamp(static_cast<int>(length_px / kPointSpacing_px), kMinScanPoints, kMaxPoints);
  const double end = skipped_end(length_px);
  for (int k = 0; k < points; ++k) {
    const double share = end + (1 - 2 * end) * k / (points - 1);
    if (share >= stretch.from && share <= stretch.to)
      visit(Eigen::Vector2d(edge.a + share * along));
  }
}

std::optional<Side> fit_side(const SideScan& scan, const SideGeometry& edge,
                             const Stretch& stretch = {}) {
  LineFit fit(edge.a);
  double spread_px2 = 0;
  const double limit = max_paper_gray(scan, edge);
  for_each_point(edge, stretch, [&](const Eigen::Vector2d& px) {
    const auto rise = scan.rise(px, edge.outward, limit);
    if (!rise) return;
    const double bias_px = scan.bias_px(px, edge.outward, edge.cell_px);
    fit.add(px + (rise->mean_px - bias_px) * edge.outward);
    spread_px2 += rise->variance_px2;
  });
  const auto line = fit.line();
  if (!line) return std::nullopt;
  return Side{*line, std::sqrt(spread_px2 / fit.points())};
}

/// Gray across [a, b], mean along it; nullopt outside of the image.
std::optional<SideProfile> profile_of(const SideScan& scan, const Eigen::Vector2d& a,
                                      const Eigen::Vector2d& b, const Eigen::Vector2d& outward,
                                      double cell_px) {
  SideProfile out{};
  for (int k = 0; k < kProfiles; ++k) {
    const Eigen::Vector2d px = a + (k + 0.5) / kProfiles * (b - a);
    for (std::size_t j = 0; j < out.size(); ++j) {
      const double t = -1 + 2.0 * static_cast<double>(j) / static_cast<double>(out.size() - 1);
      const Eigen::Vector2d at = px + t * cell_px * outward;
      if (!scan.holds(at)) return std::nullopt;
      out[j] += scan.gray(at) / kProfiles;
    }
  }
  return out;
}

/// Outward offset of a blurred half of a side, cells; repeated from the position found.
std::optional<double> locate_half(const SideScan& scan, const Eigen::Vector2d& first,
                                  const Eigen::Vector2d& last, const Eigen::Vector2d& n,
                                  double cell_px, double blur,
                                  const std::optional<TagLevels>& levels) {
  double off = 0;
  for (int round = 0; round < kMaxRepeats; ++round) {
    const Eigen::Vector2d moved = off * cell_px * n;
    const auto gray = profile_of(scan, first + moved, last + moved, n, cell_px);
    const auto found = gray ? find_blurred_edge(*gray, blur, levels) : std::nullopt;
    if (!found) return std::nullopt;
    off += found->offset;
    blur = found->blur;
    if (std::abs(found->offset) < kWellPlaced) break;
  }
  return off;
}

/// Line through the blurred edges of both halves of a side.
std::optional<Line> fit_blurred(const SideScan& scan, SideGeometry edge, const Line& line,
                                double blur, const std::optional<TagLevels>& levels) {
  edge.move_to(line);
  const Eigen::Vector2d n = line.n.dot(edge.outward) < 0 ? Eigen::Vector2d(-line.n) : line.n;
  std::array<Eigen::Vector2d, 2> middles;
  for (std::size_t half = 0; half < 2; ++half) {
    const double begin = half == 0 ? kCornerShare : 0.5;
    const double end = half == 0 ? 0.5 : 1 - kCornerShare;
    const Eigen::Vector2d first = edge.a + begin * (edge.b - edge.a);
    const Eigen::Vector2d last = edge.a + end * (edge.b - edge.a);
    const auto off = locate_half(scan, first, last, n, edge.cell_px, blur, levels);
    if (!off) return std::nullopt;
    middles[half] = 0.5 * (first + last) + *off * edge.cell_px * n;
  }
  const Eigen::Vector2d along = (middles[1] - middles[0]).normalized();
  const Eigen::Vector2d across(-along.y(), along.x());
  return Line{across, across.dot(middles[0])};
}

/// Line through the steepest points of a side, with its spread. When the reach ended before the
/// side, the search is repeated from the position found; not for blurred sides, whose steepest
/// points are biased.
std::optional<Side> find_side(const SideScan& scan, SideGeometry& edge) {
  auto side = fit_side(scan, edge);
  for (int again = 0; side && !edge.is_blurred(*side) && again < kMaxRepeats; ++again) {
    if (!(edge.move_to(side->line) > kRepeatBeyond_px)) break;
    side = fit_side(scan, edge);
  }
  const double reach_px = kReach * edge.cell_px;
  if (!side || side->spread_px < kWideScanSpread_px || reach_px <= scan.reach_px) return side;
  const SideScan wide{scan.image, reach_px, scan.gradient_px};
  if (const auto seen = fit_side(wide, edge)) side->spread_px = seen->spread_px;
  return side;
}

/// Length of a side's blur along its neighbours; a lower bound, limited by the reach of the scan.
double blurred_length_px(const SideGeometry& edge, const Side& side) {
  return edge.is_blurred(side) ? std::sqrt(12.0) * side.spread_px : 0.0;
}

/// Steepest points are biased by the grid of pixels, which averages out along sides that cross it,
/// and by the neighbours of narrow cells.
bool is_biased_by_grid(const SideGeometry& edge, const Side& side) {
  if (edge.cell_px < kBalanced_px) return false;
  if (edge.cell_px < SideScan::kWide_px) return side.spread_px < kNarrowSharp_px;
  return side.spread_px < kMaxSharpSpread_px &&
         (edge.b - edge.a).cwiseAbs().minCoeff() < kMaxCrossed_px;
}

/// A sharp side, located by the sum of its gray.
std::optional<Line> fit_balanced(const SideScan& scan, SideGeometry edge, const Line& line,
                                 const Stretch& stretch) {
  edge.move_to(line);
  const double half_px = std::min(0.5 * edge.cell_px, kMaxHalf_px);
  const double uniform_px = std::clamp(edge.min_cell_px - half_px, half_px, kMaxUniform_px);
  // Keeps the neighbours at acute corners out of the black.
  const double length_px = (edge.b - edge.a).norm();
  const double end = skipped_end(length_px);
  const Stretch black{std::max(stretch.from, end + edge.lean_a * uniform_px / length_px),
                      std::min(stretch.to, 1 - end - edge.lean_b * uniform_px / length_px)};
  LineFit fit(edge.a);
  for_each_point(edge, black, [&](const Eigen::Vector2d& px) {
    const auto off = scan.balance(px, edge.outward, half_px, uniform_px);
    if (off && std::abs(*off) < kMaxOff_px) fit.add(px + *off * edge.outward);
  });
  return fit.line();
}

using Sides = std::array<std::optional<Side>, 4>;

/// Side i without the ends that blur along it mixes with the corners.
Stretch unblurred_stretch(const std::array<SideGeometry, 4>& edges, const Sides& sides,
                          std::size_t i) {
  const std::size_t before = (i + 3) % 4;
  const std::size_t after = (i + 1) % 4;
  const double length_px = (edges[i].b - edges[i].a).norm();
  return {blurred_length_px(edges[before], *sides[before]) / length_px,
          1 - blurred_length_px(edges[after], *sides[after]) / length_px};
}

Line steepest_line(const SideScan& scan, const SideGeometry& edge, const Side& side,
                   const Stretch& stretch) {
  if (stretch.from == 0 && stretch.to == 1) return side.line;
  const auto again = fit_side(scan, edge, stretch);
  return again ? again->line : side.line;
}

/// Of a side without blur across it.
Line sharp_line(const SideScan& scan, const SideGeometry& edge, const Side& side,
                const Stretch& stretch) {
  if (is_biased_by_grid(edge, side))
    if (const auto balanced = fit_balanced(scan, edge, side.line, stretch)) return *balanced;
  return steepest_line(scan, edge, side, stretch);
}

/// Measured at the sides blurred over less than a cell.
std::optional<TagLevels> levels_of(const SideScan& scan, const std::array<SideGeometry, 4>& edges,
                                   const Sides& sides) {
  TagLevels sum;
  int points = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const SideGeometry& edge = edges[i];
    if (edge.blur_of_side(*sides[i]) > kMaxBlurOfLevels) continue;
    for (int k = 0; k < kProfiles; ++k) {
      const double share = kLevelsMargin + (1 - 2 * kLevelsMargin) * (k + 0.5) / kProfiles;
      const Eigen::Vector2d px = edge.a + share * (edge.b - edge.a);
      const Eigen::Vector2d inner = px - 0.5 * edge.cell_px * edge.outward;
      const Eigen::Vector2d outer = px + 0.5 * edge.cell_px * edge.outward;
      if (!scan.holds(inner) || !scan.holds(outer)) continue;
      sum.black += scan.gray(inner);
      sum.white += scan.gray(outer);
      ++points;
    }
  }
  if (points < LineFit::kMinPoints) return std::nullopt;
  return TagLevels{sum.black / points, sum.white / points};
}

}  // namespace

double skipped_end(double length_px) {
  return std::min(kMaxSkippedEnd, kSkippedEnd_px / length_px);
}

std::optional<FittedSides> fit_sides(const GrayImage& image, const TagCorners& corners_px,
                                     int cells) {
  const double cell_px = outline_of(corners_px).width_px / cells;
  if (!(cell_px > 0)) return std::nullopt;
  const SideScan scan{image, std::clamp(kReach * cell_px, kMinReach_px, kMaxReach_px),
                      std::clamp(kGradient * cell_px, kMinGradient_px, kMaxGradient_px)};
  std::array<SideGeometry, 4> edges{{{corners_px, 0, cells},
                                     {corners_px, 1, cells},
                                     {corners_px, 2, cells},
                                     {corners_px, 3, cells}}};
  Sides sides;
  for (std::size_t i = 0; i < 4; ++i) {
    sides[i] = find_side(scan, edges[i]);
    if (!sides[i]) return std::nullopt;
  }
  const auto levels = levels_of(scan, edges, sides);
  FittedSides out;
  std::array<Line, 4> lines;
  for (std::size_t i = 0; i < 4; ++i) {
    const SideGeometry& edge = edges[i];
    const Side& side = *sides[i];
    const Stretch stretch = unblurred_stretch(edges, sides, i);
    if (!edge.is_blurred(side)) {
      lines[i] = sharp_line(scan, edge, side, stretch);
      continue;
    }
    lines[i] = steepest_line(scan, edge, side, stretch);
    const auto blurred = fit_blurred(scan, edge, lines[i], edge.blur_of_side(side), levels);
    if (blurred) lines[i] = *blurred;
    out.guessed[i] = !blurred;
  }
  for (std::size_t i = 0; i < 4; ++i) {
    out.corners_px[i] = intersection(lines[(i + 3) % 4], lines[i]);
    if (!((out.corners_px[i] - corners_px[i]).norm() < std::max(1.0, kMaxMoved * cell_px)))
      return std::nullopt;  // also for NaN
  }
  return out;
}

}  // namespace fiducap
