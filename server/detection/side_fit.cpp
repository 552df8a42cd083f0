#include "detection/side_fit.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "detection/line_fit.hpp"
#include "detection/side_scan.hpp"
#include "detection/smeared_side.hpp"
#include "detection/tag_outline.hpp"

namespace fiducap {

namespace {

constexpr double kPointEvery_px = 1.3;
constexpr int kFewestPoints = 16;
constexpr int kMostPoints = 80;
constexpr double kEnd_px = 3.5;
constexpr double kMostEnd = 0.12;
// Of the contrast: noise and uneven light make paper so much brighter than its mean.
constexpr double kBrighter = 0.05;
// How far from the given side an edge is looked for, and over which distance its steepness is
// taken: shares of a module, so that the next module stays out of it.
constexpr double kReach = 0.6;
constexpr double kLeastReach_px = 1.0;
constexpr double kMostReach_px = 3.0;
constexpr double kGradient = 0.4;
constexpr double kLeastGradient_px = 0.5;
constexpr double kMostGradient_px = 1.0;
// Sides that are looked at by what their gray adds up to: of modules that are wide enough for it,
// if narrow, or if the side crosses fewer rows or columns of pixels. How far to both sides it is
// added up, and up to where black and white are plain.
constexpr double kBalanced_px = 1.8;
constexpr double kCrossed_px = 2.0;
constexpr double kMostHalf_px = 1.5;
constexpr double kMostPlain_px = kEnd_px;
constexpr double kSharp_px = 0.7;  // RMS of the rise; 0.57 where nothing moves
constexpr double kNarrowSharp_px = 0.9;
constexpr double kMostOff_px = 1.2;
// Gray that rises over more than this share of a module, RMS, is smeared by motion; whether it is,
// a narrow border does not show.
constexpr double kSmeared = 0.2;
constexpr double kSmearedFrom_px = 3.0;
// Wide modules are looked at again when it is more than this: the reach above ends before a fifth
// of them.
constexpr double kMostSharp_px = 1.35;
// A side that is so far from where it was looked for is looked for again, at most so often.
constexpr double kFarOff_px = 0.5;
constexpr int kMostAgain = 4;
constexpr double kWellPlaced = 0.2;  // modules; of a smeared one
// Black and white are looked at between the ends of a side, which smear along it reaches.
constexpr double kLevelsFrom = 0.25;
constexpr double kMostSmearOfLevels = 0.8;
// More than this, in modules, no corner moves: the detector is up to a module off where it is
// smeared.
constexpr double kMostMoved = 1.5;
constexpr int kProfiles = 12;     // along half a side
constexpr double kCorner = 0.06;  // of a side, at both ends: the other side is smeared into it

/// What is no brighter than the quiet zone beside [a, b], where the wall beyond is: a sunlit wall
/// around a print in the shade is another step, a module further out.
double brightest_paper(const SideScan& scan, const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                       const Eigen::Vector2d& outward, double module_px) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  double wall = 0;
  double white = 0;
  double black = 0;
  int seen = 0;
  for (int k = 0; k < kFewestPoints; ++k) {
    const Eigen::Vector2d px = a + (k + 1.0) / (kFewestPoints + 1) * (b - a);
    const Eigen::Vector2d outer = px + 0.5 * module_px * outward;
    const Eigen::Vector2d inner = px - 0.5 * module_px * outward;
    const Eigen::Vector2d beyond = px + 1.5 * module_px * outward;
    if (!scan.holds(inner) || !scan.holds(beyond)) continue;
    wall += scan.gray(beyond);
    white += scan.gray(outer);
    black += scan.gray(inner);
    ++seen;
  }
  const double most = white + kBrighter * (white - black);
  return seen > 0 && wall > most ? most / seen : kNone;
}

/// A side as it was found, and over what its gray rises.
struct Side {
  Line line;
  double spread_px;  ///< RMS
};

/// What of a side is looked at, as a share of the way along it.
struct Stretch {
  double from{0};
  double to{1};
};

/// Calls `see` with points along [a, b], a pixel or so apart, but for its ends.
template <class See>
void walk(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Stretch& stretch, See see) {
  const double length_px = (b - a).norm();
  const int points =
      std::clamp(static_cast<int>(length_px / kPointEvery_px), kFewestPoints, kMostPoints);
  const double end = left_out_at_ends(length_px);
  for (int k = 0; k < points; ++k) {
    const double share = end + (1 - 2 * end) * k / (points - 1);
    if (share >= stretch.from && share <= stretch.to) see(Eigen::Vector2d(a + share * (b - a)));
  }
}

std::optional<Side> fit_side(const SideScan& scan, const Eigen::Vector2d& a,
                             const Eigen::Vector2d& b, const Eigen::Vector2d& outward,
                             double module_px, const Stretch& stretch) {
  LineFit fit(a);
  double spread_px2 = 0;
  const double most = brightest_paper(scan, a, b, outward, module_px);
  walk(a, b, stretch, [&](const Eigen::Vector2d& px) {
    const auto rise = scan.rise(px, outward, most);
    if (!rise) return;
    const double pull_px = scan.pull_px(px, outward, module_px);
    fit.add(px + (rise->mean_px - pull_px) * outward);
    spread_px2 += rise->variance_px2;
  });
  const auto line = fit.line();
  if (!line) return std::nullopt;
  return Side{*line, std::sqrt(spread_px2 / fit.seen())};
}

/// Gray across [a, b], mean along it; nullopt where it leaves the image.
std::optional<SideProfile> profile_of(const SideScan& scan, const Eigen::Vector2d& a,
                                      const Eigen::Vector2d& b, const Eigen::Vector2d& outward,
                                      double module_px) {
  SideProfile out{};
  for (int k = 0; k < kProfiles; ++k) {
    const Eigen::Vector2d px = a + (k + 0.5) / kProfiles * (b - a);
    for (std::size_t j = 0; j < out.size(); ++j) {
      const double t = -1 + 2.0 * static_cast<double>(j) / static_cast<double>(out.size() - 1);
      const Eigen::Vector2d at = px + t * module_px * outward;
      if (!scan.holds(at)) return std::nullopt;
      out[j] += scan.gray(at) / kProfiles;
    }
  }
  return out;
}

/// How far outwards a smeared half of a side is, modules; looked at again from where it was found.
std::optional<double> find_half(const SideScan& scan, const Eigen::Vector2d& first,
                                const Eigen::Vector2d& last, const Eigen::Vector2d& n,
                                double module_px, double smear,
                                const std::optional<TagLevels>& levels) {
  double off = 0;
  for (int look = 0; look < kMostAgain; ++look) {
    const Eigen::Vector2d moved = off * module_px * n;
    const auto gray = profile_of(scan, first + moved, last + moved, n, module_px);
    const auto found = gray ? find_smeared_side(*gray, smear, levels) : std::nullopt;
    if (!found) return std::nullopt;
    off += found->off;
    smear = found->smear;
    if (std::abs(found->off) < kWellPlaced) break;
  }
  return off;
}

/// The side again, from both of its halves, by what its smeared gray adds up from.
std::optional<Line> fit_smeared(const SideScan& scan, const Eigen::Vector2d& a,
                                const Eigen::Vector2d& b, const Line& line, double module_px,
                                double smear, const Eigen::Vector2d& outward,
                                const std::optional<TagLevels>& levels) {
  const Eigen::Vector2d from = a + (line.c - line.n.dot(a)) * line.n;
  const Eigen::Vector2d to = b + (line.c - line.n.dot(b)) * line.n;
  const Eigen::Vector2d n = line.n.dot(outward) < 0 ? Eigen::Vector2d(-line.n) : line.n;
  std::array<Eigen::Vector2d, 2> places;
  for (std::size_t half = 0; half < 2; ++half) {
    const double begin = half == 0 ? kCorner : 0.5;
    const double end = half == 0 ? 0.5 : 1 - kCorner;
    const Eigen::Vector2d first = from + begin * (to - from);
    const Eigen::Vector2d last = from + end * (to - from);
    const auto off = find_half(scan, first, last, n, module_px, smear, levels);
    if (!off) return std::nullopt;
    places[half] = 0.5 * (first + last) + *off * module_px * n;
  }
  const Eigen::Vector2d along = (places[1] - places[0]).normalized();
  const Eigen::Vector2d across(-along.y(), along.x());
  return Line{across, across.dot(places[0])};
}

/// One side of the tag, as it is looked for.
struct Place {
  Eigen::Vector2d a, b;
  Eigen::Vector2d outward;
  double module_px;
  double narrowest_px;  ///< The least across it: its far end, if it is the far side.
  /// How far along it the neighbour at either end leads, per pixel inwards; 0: not over the side.
  double lean_a, lean_b;

  Place(const std::array<Eigen::Vector2d, 4>& corners_px, std::size_t i, int modules)
      : a(corners_px[i]), b(corners_px[(i + 1) % 4]) {
    const Eigen::Vector2d middle =
        0.25 * (corners_px[0] + corners_px[1] + corners_px[2] + corners_px[3]);
    const Eigen::Vector2d along = (b - a).normalized();
    outward = {-along.y(), along.x()};
    if (outward.dot(a - middle) < 0) outward = -outward;
    module_px = 2 * outward.dot(a - middle) / modules;
    const Eigen::Vector2d& behind_b = corners_px[(i + 2) % 4];
    const Eigen::Vector2d& behind_a = corners_px[(i + 3) % 4];
    const double across_px = std::min(outward.dot(a - behind_a), outward.dot(b - behind_b));
    narrowest_px =
        across_px / modules * std::min(1.0, (b - a).norm() / (behind_b - behind_a).norm());
    lean_a = std::max(0.0, along.dot(behind_a - a) / outward.dot(a - behind_a));
    lean_b = std::max(0.0, along.dot(b - behind_b) / outward.dot(b - behind_b));
  }

  [[nodiscard]] bool is_smeared(const Side& side) const {
    return !(side.spread_px < kSmeared * module_px || module_px < kSmearedFrom_px);
  }

  /// Over how many modules, as far as the reach of a scan shows it.
  [[nodiscard]] double smear_of(const Side& side) const {
    return std::sqrt(12.0) * side.spread_px / module_px;
  }

  /// Its ends move onto the line. @return how far, at most
  double move_to(const Line& line) {
    const Eigen::Vector2d step_a = (line.c - line.n.dot(a)) * line.n;
    const Eigen::Vector2d step_b = (line.c - line.n.dot(b)) * line.n;
    a += step_a;
    b += step_b;
    return std::max(step_a.norm(), step_b.norm());
  }
};

/// A side by its steepest place, and how far it is smeared. Where the detector was far off, the
/// reach ended before the side: it is looked for again from where that led, but for smeared ones,
/// whose steepest place is not where they are.
std::optional<Side> find_side(const SideScan& scan, Place& place) {
  auto side = fit_side(scan, place.a, place.b, place.outward, place.module_px, {});
  for (int again = 0; side && !place.is_smeared(*side) && again < kMostAgain; ++again) {
    if (!(place.move_to(side->line) > kFarOff_px)) break;
    side = fit_side(scan, place.a, place.b, place.outward, place.module_px, {});
  }
  const double reach_px = kReach * place.module_px;
  if (!side || side->spread_px < kMostSharp_px || reach_px <= scan.reach_px) return side;
  const SideScan wide{scan.image, reach_px, scan.gradient_px};
  if (const auto seen = fit_side(wide, place.a, place.b, place.outward, place.module_px, {}))
    side->spread_px = seen->spread_px;
  return side;
}

/// How far a smeared side reaches along its neighbours; at least, as the reach of a scan ends.
double smear_px(const Place& place, const Side& side) {
  return place.is_smeared(side) ? std::sqrt(12.0) * side.spread_px : 0.0;
}

/// Steepest places are drawn to the grid of pixels, which averages out along sides that cross it,
/// and by what lies beside narrow modules.
bool is_drawn_aside(const Place& place, const Side& side) {
  if (place.module_px < kBalanced_px) return false;
  if (place.module_px < SideScan::kAlone_px) return side.spread_px < kNarrowSharp_px;
  return side.spread_px < kSharp_px && (place.b - place.a).cwiseAbs().minCoeff() < kCrossed_px;
}

/// A sharp side again, by what gray adds up to.
std::optional<Line> fit_balanced(const SideScan& scan, Place place, const Line& line,
                                 const Stretch& stretch) {
  place.move_to(line);
  const double half_px = std::min(0.5 * place.module_px, kMostHalf_px);
  const double plain_px = std::clamp(place.narrowest_px - half_px, half_px, kMostPlain_px);
  // Where neighbours at sharp corners stay out of the black.
  const double length_px = (place.b - place.a).norm();
  const double end = left_out_at_ends(length_px);
  const Stretch black{std::max(stretch.from, end + place.lean_a * plain_px / length_px),
                      std::min(stretch.to, 1 - end - place.lean_b * plain_px / length_px)};
  LineFit fit(place.a);
  walk(place.a, place.b, black, [&](const Eigen::Vector2d& px) {
    const auto off = scan.balance(px, place.outward, half_px, plain_px);
    if (off && std::abs(*off) < kMostOff_px) fit.add(px + *off * place.outward);
  });
  return fit.line();
}

using Sides = std::array<std::optional<Side>, 4>;

/// What of side i is looked at: where a tag is smeared along it, its ends are corners smeared into
/// each other.
Stretch sharp_stretch(const std::array<Place, 4>& places, const Sides& sides, std::size_t i) {
  const std::size_t before = (i + 3) % 4;
  const std::size_t after = (i + 1) % 4;
  const double length_px = (places[i].b - places[i].a).norm();
  return {smear_px(places[before], *sides[before]) / length_px,
          1 - smear_px(places[after], *sides[after]) / length_px};
}

/// Without the ends that are left out.
Line steepest_line(const SideScan& scan, const Place& place, const Side& side,
                   const Stretch& stretch) {
  if (stretch.from == 0 && stretch.to == 1) return side.line;
  const auto again = fit_side(scan, place.a, place.b, place.outward, place.module_px, stretch);
  return again ? again->line : side.line;
}

/// A side that is not smeared across itself.
Line line_of_sharp(const SideScan& scan, const Place& place, const Side& side,
                   const Stretch& stretch) {
  if (is_drawn_aside(place, side)) {
    if (const auto balanced = fit_balanced(scan, place, side.line, stretch)) return *balanced;
  }
  return steepest_line(scan, place, side, stretch);
}

/// As the sides show them that are smeared over less than a module.
std::optional<TagLevels> levels_of(const SideScan& scan, const std::array<Place, 4>& places,
                                   const Sides& sides) {
  TagLevels sum;
  int seen = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Place& place = places[i];
    if (place.smear_of(*sides[i]) > kMostSmearOfLevels) continue;
    for (int k = 0; k < kProfiles; ++k) {
      const double share = kLevelsFrom + (1 - 2 * kLevelsFrom) * (k + 0.5) / kProfiles;
      const Eigen::Vector2d px = place.a + share * (place.b - place.a);
      const Eigen::Vector2d inner = px - 0.5 * place.module_px * place.outward;
      const Eigen::Vector2d outer = px + 0.5 * place.module_px * place.outward;
      if (!scan.holds(inner) || !scan.holds(outer)) continue;
      sum.black += scan.gray(inner);
      sum.white += scan.gray(outer);
      ++seen;
    }
  }
  if (seen < LineFit::kFewestPoints) return std::nullopt;
  return TagLevels{sum.black / seen, sum.white / seen};
}

}  // namespace

double left_out_at_ends(double length_px) { return std::min(kMostEnd, kEnd_px / length_px); }

std::optional<FittedSides> fit_sides(const GrayImage& image,
                                     const std::array<Eigen::Vector2d, 4>& corners_px,
                                     int modules) {
  const double module_px = outline_of(corners_px).width_px / modules;
  if (!(module_px > 0)) return std::nullopt;
  const SideScan scan{image, std::clamp(kReach * module_px, kLeastReach_px, kMostReach_px),
                      std::clamp(kGradient * module_px, kLeastGradient_px, kMostGradient_px)};
  std::array<Place, 4> places{{{corners_px, 0, modules},
                               {corners_px, 1, modules},
                               {corners_px, 2, modules},
                               {corners_px, 3, modules}}};
  Sides sides;
  for (std::size_t i = 0; i < 4; ++i) {
    sides[i] = find_side(scan, places[i]);
    if (!sides[i]) return std::nullopt;
  }
  const auto levels = levels_of(scan, places, sides);
  FittedSides out;
  std::array<Line, 4> lines;
  for (std::size_t i = 0; i < 4; ++i) {
    const Place& place = places[i];
    const Side& side = *sides[i];
    const Stretch stretch = sharp_stretch(places, sides, i);
    if (!place.is_smeared(side)) {
      lines[i] = line_of_sharp(scan, place, side, stretch);
      continue;
    }
    lines[i] = steepest_line(scan, place, side, stretch);
    const auto smeared = fit_smeared(scan, place.a, place.b, lines[i], place.module_px,
                                     place.smear_of(side), place.outward, levels);
    if (smeared) lines[i] = *smeared;
    out.guessed[i] = !smeared;
  }
  for (std::size_t i = 0; i < 4; ++i) {
    const Line& before = lines[(i + 3) % 4];
    const Line& after = lines[i];
    Eigen::Matrix2d N;
    N << before.n.transpose(), after.n.transpose();
    out.corners_px[i] = N.inverse() * Eigen::Vector2d(before.c, after.c);
    if (!((out.corners_px[i] - corners_px[i]).norm() < std::max(1.0, kMostMoved * module_px)))
      return std::nullopt;  // NaN fails too
  }
  return out;
}

}  // namespace fiducap
