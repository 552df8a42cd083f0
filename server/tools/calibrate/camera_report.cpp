#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "capture/lens/calibration_files.hpp"
#include "tools/calibrate/calibrate.hpp"

namespace fiducap {
namespace {

std::array<const char*, kLensNumbers> number_names(Distortion kind) {
  if (kind == Distortion::kEquidistant) return {"fu", "fv", "cu", "cv", "k1", "k2", "k3", "k4"};
  return {"fu", "fv", "cu", "cv", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
}

const char* verdict_text(IntrinsicsGrade grade) {
  return grade == IntrinsicsGrade::kGood   ? "good enough"
         : grade == IntrinsicsGrade::kWeak ? "usable, could be better"
                                           : "refused";
}

const char* word_for(IntrinsicsGrade grade) {
  return grade == IntrinsicsGrade::kGood   ? "good"
         : grade == IntrinsicsGrade::kWeak ? "weak"
                                           : "useless";
}

nlohmann::ordered_json numbers_json(const IntrinsicsCalibration& c) {
  nlohmann::ordered_json out;
  const auto names = number_names(c.state.camera.distortion);
  const LensVector values = numbers_of(c.state.camera);
  for (const int i : c.free)
    out[names[static_cast<std::size_t>(i)]] = {
        {"value", values(i)}, {"sigma", std::sqrt(c.uncertainty.covariance(i, i))}};
  return out;
}

std::vector<std::string> names_of(const std::vector<int>& numbers, Distortion kind) {
  std::vector<std::string> out;
  for (const int i : numbers) out.emplace_back(number_names(kind)[static_cast<std::size_t>(i)]);
  return out;
}

/// Coefficients that the images do not determine.
std::vector<std::string> held_names(const IntrinsicsCalibration& c) {
  const Distortion kind = c.state.camera.distortion;
  std::vector<int> held;
  for (int i = 4; i < 4 + static_cast<int>(coefficients_of(kind)); ++i)
    if (std::ranges::find(c.free, i) == c.free.end()) held.push_back(i);
  return names_of(held, kind);
}

nlohmann::ordered_json checks_json(const IntrinsicsCalibration& c, const IntrinsicsVerdict& v) {
  const HeldOut& held_out = c.held_out;
  const TargetShape& board = c.shape;
  nlohmann::ordered_json out{{"image_folded", v.shape.folded},
                             {"focal_ratio", v.shape.aspect},
                             {"principal_point_off", v.shape.centre_off},
                             {"focal_sigma", v.focal_sigma},
                             {"focal_scatter", c.uncertainty.focal_scatter},
                             {"condition", c.uncertainty.condition},
                             {"tilt_deg", v.tilt_rad / kDegree},
                             {"depth_spread", v.depth_spread},
                             {"targets_that_do_not_fit", c.misfits}};
  if (held_out.tried)
    out["held_out"] = {{"ratio", held_out.ratio},
                       {"first_focal", held_out.first_focal},
                       {"second_focal", held_out.second_focal},
                       {"step_sigma", held_out.focal_step_sigma()}};
  if (board.known)
    out["board"] = {{"bend", board.bend},
                    {"bend_sigma", board.bend_sigma},
                    {"stretch", board.stretch},
                    {"stretch_sigma", board.stretch_sigma}};
  return out;
}

nlohmann::ordered_json cells_json(const ImageMap& map) {
  nlohmann::ordered_json cells = nlohmann::ordered_json::array();
  for (const ImageCell& cell : map.cells)
    cells.push_back({{"centre_px", {cell.centre_px.x(), cell.centre_px.y()}},
                     {"corners", cell.points},
                     {"reprojection_rms_px", cell.rms_px},
                     {"reprojection_mean_px", {cell.mean_px.x(), cell.mean_px.y()}},
                     {"uncertainty_px", cell.in_lens ? nlohmann::ordered_json(cell.uncertainty_px)
                                                     : nlohmann::ordered_json(nullptr)}});
  return {{"columns", map.columns}, {"rows", map.rows}, {"cells", cells}};
}

void print_lens(const Terminal& terminal, const IntrinsicsCalibration& c) {
  terminal.out << "  lens " << name_of(c.state.camera.distortion);
  for (std::size_t i = 0; i < c.trials.size(); ++i)
    terminal.out << (i == 0 ? ": " : "; " + name_of(c.trials[i].distortion) + ": ")
                 << fixed(c.trials[i].sigma_px, 3) << " px unexplained";
  terminal.out << "\n";
  const auto names = number_names(c.state.camera.distortion);
  const LensVector values = numbers_of(c.state.camera);
  for (const int i : c.free) {
    const int decimals = i < 4 ? 3 : 5;
    terminal.out << "    " << names[static_cast<std::size_t>(i)] << "  "
                 << fixed(values(i), decimals) << " ± "
                 << fixed(std::sqrt(c.uncertainty.covariance(i, i)), decimals)
                 << (i < 4 ? " px" : "") << "\n";
  }
  if (const auto held = held_names(c); !held.empty())
    terminal.out << "    " << comma_list(held) << "  held at 0: the images do not determine them\n";
}

constexpr std::size_t kMostDots = 6000;
constexpr PlotPoint kBreak{kPlotGap, kPlotGap};

/// Pixels below each bound have the colour; the last but one is for larger ones, the last for cells
/// without a number.
constexpr std::array<double, 5> kBounds_px{0.05, 0.1, 0.2, 0.5, 1.0};
constexpr std::array<const char*, 7> kCellColors{"#1a9850", "#91cf60", "#d9ef8b", "#fee08b",
                                                 "#fc8d59", "#d73027", "#9aa3ad"};

PlotPoint point(const Eigen::Vector2d& px) { return {px.x(), px.y()}; }

class CameraPlots final {
 public:
  explicit CameraPlots(const CameraOutcome& outcome)
      : c_(outcome.calibration), map_(outcome.map), v_(outcome.verdict) {}

  [[nodiscard]] PlotPage page() const {
    const CameraModel& camera = c_.state.camera;
    PlotPage page;
    page.title = std::string("Verdict: ") + verdict_text(v_.grade);
    page.remarks = {"fu " + fixed(camera.fu, 2) + "  fv " + fixed(camera.fv, 2) + "  cu " +
                    fixed(camera.cu, 2) + "  cv " + fixed(camera.cv, 2) + " px;  " +
                    std::to_string(v_.images) + " images, " + std::to_string(v_.points) +
                    " corners"};
    for (const std::string& advice : v_.advice) page.remarks.push_back("• " + advice);
    page.plots = {coverage(), reprojection(), uncertainty()};
    return page;
  }

 private:
  /// The image in pixels. @param class_of  index of the group of a cell
  template <typename Class>
  [[nodiscard]] LinePlot image_plot(const std::string& title, std::vector<PlotShapes> groups,
                                    const Class& class_of) const {
    LinePlot plot{title, "u, px", {{"v, px"}}};
    plot.equal_axes = plot.y_down = true;
    const double w = static_cast<double>(c_.data.width) / map_.columns;
    const double h = static_cast<double>(c_.data.height) / map_.rows;
    for (int row = 0; row < map_.rows; ++row)
      for (int column = 0; column < map_.columns; ++column) {
        const double u = column * w - 0.5;
        const double v = row * h - 0.5;
        groups[class_of(map_.at(column, row))].shapes.push_back(
            {{{u, v}, {u + w, v}, {u + w, v + h}, {u, v + h}}, ""});
      }
    plot.panels.front().shapes = std::move(groups);
    return plot;
  }

  /// Cells coloured by a number of pixels. @param number  of a cell; nullopt: none
  template <typename Number>
  [[nodiscard]] LinePlot number_plot(const std::string& title, const Number& number) const {
    std::vector<PlotShapes> groups;
    for (std::size_t i = 0; i < kBounds_px.size(); ++i)
      groups.push_back({"to " + fixed(kBounds_px[i], 2) + " px", kCellColors[i]});
    groups.push_back({"more", kCellColors[5]});
    groups.push_back({"unknown", kCellColors[6]});
    return image_plot(title, std::move(groups), [&](const ImageCell& cell) -> std::size_t {
      const std::optional<double> px = number(cell);
      if (!px) return 6;
      return static_cast<std::size_t>(std::lower_bound(kBounds_px.begin(), kBounds_px.end(), *px) -
                                      kBounds_px.begin());
    });
  }

  [[nodiscard]] LinePlot coverage() const {
    LinePlot plot =
        image_plot("Coverage: " + fixed(100 * v_.covered, 0) + " % of the image, up to " +
                       fixed(v_.seen_angle_rad / kDegree, 0) + "° of " +
                       fixed(v_.image_angle_rad / kDegree, 0) + "° off the axis",
                   {{"covered", kPlotColors[5]}, {"too few corners", kPlotColors[1]}},
                   [](const ImageCell& cell) { return cell.points >= kCoveringPoints ? 0u : 1u; });
    PlotLine corners{"corners", kPlotColors[0], {}, false, 2, true};
    const std::size_t step = c_.residuals.size() / kMostDots + 1;
    std::size_t i = 0;
    for (const CalibrationView& view : c_.data.views)
      for (const TargetSighting& sighting : view.sightings)
        for (const SeenPoint& seen : sighting.points)
          if (i++ % step == 0) corners.points.push_back(point(seen.px));
    plot.panels.front().lines = {std::move(corners), rings()};
    return plot;
  }

  /// Directions of equal angle off the axis, every 10° or 20°.
  [[nodiscard]] PlotLine rings() const {
    const double step = (v_.image_angle_rad > 50 * kDegree ? 20 : 10) * kDegree;
    PlotLine line{"every " + fixed(step / kDegree, 0) + "° off the axis", kPlotGray, {}, true, 0.8};
    for (double angle = step; angle < v_.image_angle_rad; angle += step) {
      for (int i = 0; i <= 72; ++i) {
        const double turn = i * 5 * kDegree;
        const auto px = c_.state.camera.project(
            {std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), std::cos(angle)});
        const bool is_inside = px && px->x() >= 0 && px->y() >= 0 && px->x() < c_.data.width &&
                               px->y() < c_.data.height;
        line.points.push_back(is_inside ? point(*px) : kBreak);
      }
      line.points.push_back(kBreak);
    }
    return line;
  }

  [[nodiscard]] LinePlot reprojection() const {
    double largest_px = 0.1;
    for (const ImageCell& cell : map_.cells)
      if (cell.points >= kCoveringPoints) largest_px = std::max(largest_px, cell.mean_px.norm());
    const double magnified = c_.data.width / (2.0 * map_.columns) / largest_px;
    LinePlot plot =
        number_plot("Reprojection: " + fixed(v_.reprojection_rms_px, 2) +
                        " px RMS; lines: mean, × " + fixed(magnified, 0),
                    [](const ImageCell& cell) {
                      return cell.points > 0 ? std::optional(cell.rms_px) : std::nullopt;
                    });
    PlotLine means{"mean of a cell", kPlotInk, {}, false, 1.6};
    for (const ImageCell& cell : map_.cells) {
      if (cell.points < kCoveringPoints) continue;
      means.points.push_back(point(cell.centre_px));
      means.points.push_back(point(cell.centre_px + magnified * cell.mean_px));
      means.points.push_back(kBreak);
    }
    plot.panels.front().lines = {std::move(means)};
    return plot;
  }

  [[nodiscard]] LinePlot uncertainty() const {
    return number_plot("Directions: ± " + fixed(v_.uncertainty_median_px, 2) +
                           " px in the median, " + fixed(v_.uncertainty_worst_px, 2) + " at worst",
                       [](const ImageCell& cell) {
                         return cell.in_lens ? std::optional(cell.uncertainty_px) : std::nullopt;
                       });
  }

  const IntrinsicsCalibration& c_;
  const ImageMap& map_;
  const IntrinsicsVerdict& v_;
};

}  // namespace

nlohmann::ordered_json to_camera_json(const CameraOutcome& o) {
  const IntrinsicsCalibration& c = o.calibration;
  const IntrinsicsVerdict& v = o.verdict;
  nlohmann::ordered_json trials = nlohmann::ordered_json::array();
  for (const LensTrial& trial : c.trials)
    trials.push_back({{"lens", name_of(trial.distortion)},
                      {"numbers", names_of(trial.free, trial.distortion)},
                      {"sigma_px", trial.sigma_px},
                      {"can_be_a_lens", trial.sound}});
  return {
      {"verdict", word_for(v.grade)},
      {"advice", v.advice},
      {"lens", name_of(c.state.camera.distortion)},
      {"resolution", {c.data.width, c.data.height}},
      {"numbers", numbers_json(c)},
      {"held_at_zero", held_names(c)},
      {"checks", checks_json(c, v)},
      {"images", {{"looked_at", o.images}, {"with_target", o.with_target}, {"used", v.images}}},
      {"sightings", {{"used", v.sightings}, {"rejected", c.rejected}}},
      {"targets_stood_still", c.targets_joined},
      {"targets_disagree", c.targets_disagree},
      {"noise_if_they_stood_still_px", c.joined_sigma_px},
      {"covered", v.covered},
      {"seen_angle_deg", v.seen_angle_rad / kDegree},
      {"image_angle_deg", v.image_angle_rad / kDegree},
      {"tilted", v.tilted},
      {"reprojection_rms_px", v.reprojection_rms_px},
      {"noise_px", c.sigma_px},
      {"noise_correlation", c.uncertainty.correlation},
      {"misfit_px", v.misfit_px},
      {"uncertainty_px", {{"median", v.uncertainty_median_px}, {"worst", v.uncertainty_worst_px}}},
      {"lens_error_px", v.lens_error_px},
      {"lenses_tried", trials},
      {"map", cells_json(o.map)}};
}

void print_camera_report(const Terminal& terminal, const CameraOutcome& o,
                         const std::string& input) {
  const IntrinsicsCalibration& c = o.calibration;
  const IntrinsicsVerdict& v = o.verdict;
  terminal.out << fmt::format(
      "{}: {} images, {} with targets, {} used (sharp and different), {} sightings, {} rejected\n",
      input, o.images, o.with_target, v.images, v.sightings, c.rejected);
  print_lens(terminal, c);
  if (c.targets_joined)
    terminal.out << "  the tags stand still relative to each other; that was used\n";
  if (c.targets_disagree)
    terminal.out << fmt::format(
        "  taken together the tags leave {:.2f} px (moved, not flat, or sizes not as configured): "
        "each sighting is used by itself\n",
        c.joined_sigma_px);
  terminal.out << fmt::format(
      "  coverage {:.0f} % of the image, up to {:.0f}° of {:.0f}° off the axis; {:.0f} % of the "
      "sightings tilted\n  reprojection {:.3f} px RMS\n"
      "  directions uncertain by {:.3f} px in half of the image, {:.3f} px at worst\n",
      100 * v.covered, v.seen_angle_rad / kDegree, v.image_angle_rad / kDegree, 100 * v.tilted,
      v.reprojection_rms_px, v.uncertainty_median_px, v.uncertainty_worst_px);
  terminal.out << "verdict: " << verdict_text(v.grade)
               << (v.grade == IntrinsicsGrade::kUseless ? ", record again\n" : "\n");
  for (const std::string& advice : v.advice) terminal.out << "  - " << advice << "\n";
}

std::string to_camera_yaml(const IntrinsicsCalibration& calibration,
                           const IntrinsicsVerdict& verdict) {
  const CameraModel& camera = calibration.state.camera;
  const LensVector values = numbers_of(camera);
  const auto names = number_names(camera.distortion);
  CameraMount mount;
  set_lens_sigmas(calibration, verdict, mount);
  std::string sigmas;
  for (const int i : calibration.free)
    sigmas += std::string(" ") + names[static_cast<std::size_t>(i)] + " " +
              fixed(std::sqrt(calibration.uncertainty.covariance(i, i)), i < 4 ? 4 : 6);
  const int coefficients = static_cast<int>(listed_coefficients(camera).size());
  const auto list = [&](int first, int count, int decimals) {
    std::string text = "[";
    for (int i = first; i < first + count; ++i)
      text += (i == first ? "" : ", ") + fixed(values(i), decimals);
    return text + "]";
  };
  return "# Intrinsics by fiducap calibrate camera; verdict: " +
         std::string(word_for(verdict.grade)) + "\n# " + std::to_string(verdict.images) +
         " images, reprojection " + fixed(verdict.reprojection_rms_px, 3) + " px RMS, coverage " +
         fixed(100 * verdict.covered, 0) + " %\n# 1-sigma:" + sigmas +
         "\nintrinsics_sigma: {focal: " + fixed(mount.focal_sigma, 6) +
         ", centre_px: " + fixed(mount.centre_sigma_px, 4) + ", k1: " + fixed(mount.k1_sigma, 6) +
         "}\nlens_error_px: " + fixed(mount.lens_error_px, 3) +
         "  # systematic, the same in all images\ncamera_model: pinhole\nresolution: [" +
         std::to_string(camera.width) + ", " + std::to_string(camera.height) +
         "]\nintrinsics: " + list(0, 4, 6) + "\ndistortion_model: " + name_of(camera.distortion) +
         "\ndistortion_coefficients: " + list(4, coefficients, 9) + "\n";
}

PlotPage camera_plots(const CameraOutcome& outcome) { return CameraPlots(outcome).page(); }

}  // namespace fiducap
