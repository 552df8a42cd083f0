#include "calibration/intrinsics/intrinsics_verdict.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace fiducap {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kTilted_rad = 25 * kDegree;

// What a good calibration reaches. A direction is as good as a corner when the lens adds less than
// the detector (0.1 to 0.3 px); 0.2 % of focal length is 6 mm at 3 m.
constexpr int kGoodImages = 20;
constexpr double kGoodCovered = 0.8;
constexpr double kGoodTilted = 0.2;
constexpr double kGoodFocal = 2e-3;
constexpr double kGoodUncertainty_px = 0.3;
constexpr double kGoodRms_px = 1.0;
constexpr double kGoodMisfit_px = 0.15;
// What should not be used.
constexpr double kUselessCovered = 0.25;
constexpr double kUselessFocal = 0.02;
constexpr double kUselessUncertainty_px = 5;  // median over the image
constexpr double kUselessRms_px = 5;

std::string number(double value, int decimals) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string percent(double share) { return number(100 * share, 0) + " %"; }

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// What lies outside of the lens (the dark corners of a fisheye) cannot be covered.
bool can_be_seen(const ImageCell& cell) { return cell.in_lens || cell.points > 0; }

/// Parts of the image, a third of its width and height each, where less than half of the cells are
/// covered.
std::vector<std::string> empty_parts(const ImageMap& map) {
  constexpr std::array<const char*, 9> kParts{
      "upper left corner", "upper edge",        "upper right corner", "left edge",         "middle",
      "right edge",        "lower left corner", "lower edge",         "lower right corner"};
  std::array<int, 9> cells{};
  std::array<int, 9> covered{};
  for (int row = 0; row < map.rows; ++row)
    for (int column = 0; column < map.columns; ++column) {
      const auto part =
          static_cast<std::size_t>(3 * (3 * row / map.rows) + 3 * column / map.columns);
      if (!can_be_seen(map.at(column, row))) continue;
      ++cells[part];
      covered[part] += map.at(column, row).points >= kCoveringPoints ? 1 : 0;
    }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < kParts.size(); ++i)
    if (2 * covered[i] < cells[i]) names.emplace_back(kParts[i]);
  return names;
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 == names.size() ? " and the " : ", the ") + names[i];
  return text;
}

void count(const IntrinsicsCalibration& c, IntrinsicsVerdict& v) {
  std::size_t tilted = 0;
  for (std::size_t i = 0; i < c.data.views.size(); ++i) {
    const CalibrationView& view = c.data.views[i];
    v.images += view.sightings.empty() ? 0 : 1;
    for (const TargetSighting& s : view.sightings) {
      const auto t = static_cast<std::size_t>(s.target);
      const Pose X_VT = c.state.X_VG[i].at(c.state.group_of[t]) * c.state.X_GT[t];
      const Eigen::Vector3d normal = X_VT.q * Eigen::Vector3d::UnitZ();
      const double facing = std::abs(normal.dot(X_VT.p.normalized()));
      tilted += facing < std::cos(kTilted_rad) ? 1 : 0;
      ++v.sightings;
      v.points += s.points.size();
      for (const SeenPoint& seen : s.points)
        if (const auto angle = angle_of(c.state.camera, seen.px))
          v.seen_angle_rad = std::max(v.seen_angle_rad, *angle);
    }
  }
  if (v.sightings > 0) v.tilted = static_cast<double>(tilted) / static_cast<double>(v.sightings);
}

void measure(const IntrinsicsCalibration& c, const ImageMap& map, IntrinsicsVerdict& v) {
  std::vector<double> uncertainties;
  int covered = 0;
  int visible = 0;
  double systematic = 0;
  int filled = 0;
  for (const ImageCell& cell : map.cells) {
    covered += cell.points >= kCoveringPoints ? 1 : 0;
    visible += can_be_seen(cell) ? 1 : 0;
    if (cell.in_lens) uncertainties.push_back(cell.uncertainty_px);
    if (const auto angle = angle_of(c.state.camera, cell.centre_px))
      v.image_angle_rad = std::max(v.image_angle_rad, *angle);
    constexpr int kEnoughForMean = 8;
    if (cell.points < kEnoughForMean) continue;
    systematic += cell.mean_px.squaredNorm() - 2 * c.sigma_px * c.sigma_px / cell.points;
    ++filled;
  }
  v.covered = covered / static_cast<double>(std::max(visible, 1));
  v.uncertainty_median_px = median(uncertainties);
  for (const double u : uncertainties) v.uncertainty_worst_px = std::max(v.uncertainty_worst_px, u);
  v.misfit_px = filled > 0 ? std::sqrt(std::max(0.0, systematic / filled)) : 0;
  double sum = 0;
  for (const Eigen::Vector2d& r : c.residuals) sum += r.squaredNorm();
  v.reprojection_rms_px =
      std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, c.residuals.size())));
  const auto& P = c.uncertainty.covariance;
  v.focal_sigma =
      std::max(std::sqrt(P(0, 0)) / c.state.camera.fu, std::sqrt(P(1, 1)) / c.state.camera.fv);
}

void advise_on_use(const IntrinsicsCalibration& c, IntrinsicsVerdict& v) {
  const auto say = [&](bool wrong, const std::string& text) {
    if (!wrong) return;
    v.grade = IntrinsicsGrade::kUseless;
    v.advice.push_back(text);
  };
  say(v.focal_sigma > kUselessFocal,
      "The focal length is known to " + number(100 * v.focal_sigma, 1) +
          " % only: tilt the board by 30° to 50° to all sides, at several distances.");
  say(v.covered < kUselessCovered, "Only " + percent(v.covered) +
                                       " of the image was seen: bring the target to all parts of "
                                       "it, edges and corners too.");
  say(v.uncertainty_median_px > kUselessUncertainty_px,
      "Directions are uncertain by " + number(v.uncertainty_median_px, 1) +
          " px in half of the image: more images, nearer and more tilted.");
  say(v.reprojection_rms_px > kUselessRms_px,
      "Corners are " + number(v.reprojection_rms_px, 1) + " px off: is the target what was said (" +
          c.data.targets.front().name + " …), and is this lens a pinhole with " +
          "radial-tangential or equidistant distortion?");
}

void advise_on_motion(const ImageMap& map, IntrinsicsVerdict& v) {
  const auto say = [&](bool wrong, const std::string& text) {
    if (!wrong) return;
    if (v.grade == IntrinsicsGrade::kGood) v.grade = IntrinsicsGrade::kWeak;
    v.advice.push_back(text);
  };
  const auto parts = empty_parts(map);
  if (v.covered >= kUselessCovered)
    say(v.covered < kGoodCovered || !parts.empty(),
        parts.empty() ? percent(v.covered) + " of the image was seen: fill the gaps."
                      : percent(v.covered) + " of the image was seen: move the target into the " +
                            listed(parts) + ".");
  say(v.tilted < kGoodTilted, "Only " + percent(v.tilted) +
                                  " of the sightings are tilted: tilt the target by 30° to 50° to "
                                  "all sides.");
  if (v.focal_sigma <= kUselessFocal)
    say(v.focal_sigma > kGoodFocal,
        "The focal length is uncertain by " + number(100 * v.focal_sigma, 2) +
            " %: bring the target nearer, so that it fills the image, and tilt it.");
  say(v.uncertainty_worst_px > kGoodUncertainty_px,
      "Directions are uncertain by up to " + number(v.uncertainty_worst_px, 2) +
          " px (see the picture where): more corners there.");
  say(v.images < kGoodImages,
      std::to_string(v.images) + " different images: record more, 50 are plenty.");
}

void advise_on_fit(IntrinsicsVerdict& v) {
  const auto say = [&](bool wrong, const std::string& text) {
    if (!wrong) return;
    if (v.grade == IntrinsicsGrade::kGood) v.grade = IntrinsicsGrade::kWeak;
    v.advice.push_back(text);
  };
  if (v.reprojection_rms_px <= kUselessRms_px)
    say(v.reprojection_rms_px > kGoodRms_px,
        "Corners are " + number(v.reprojection_rms_px, 2) +
            " px off: move slowly, light the room, use a flat target.");
  say(v.misfit_px > kGoodMisfit_px,
      "The residuals of a part of the image agree with each other (" + number(v.misfit_px, 2) +
          " px): target not flat, sizes not as said, rolling shutter, or a lens that this model "
          "does not follow.");
  say(v.image_angle_rad > 0 && v.seen_angle_rad < 0.85 * v.image_angle_rad,
      "Corners were seen up to " + number(v.seen_angle_rad / kDegree, 0) +
          "° off the axis, the image reaches " + number(v.image_angle_rad / kDegree, 0) +
          "°: beyond, the lens is a guess.");
}

}  // namespace

IntrinsicsVerdict judge(const IntrinsicsCalibration& calibration, const ImageMap& map) {
  IntrinsicsVerdict verdict;
  count(calibration, verdict);
  measure(calibration, map, verdict);
  advise_on_use(calibration, verdict);
  advise_on_motion(map, verdict);
  advise_on_fit(verdict);
  return verdict;
}

}  // namespace fiducap
