// The paper's "Fiducial Estimation Test" and the motion of data set "table".
#include <cmath>

#include "base/pose.hpp"
#include "paper/experiments.hpp"
#include "paper/motion_plots.hpp"

namespace fiducap::bench {

namespace {

/// How wrong tag `other` is, seen from tag 0.
struct PairError {
  double distance_m{};      ///< The paper's figure: of the distance between the two.
  double displacement_m{};  ///< In tag 0's axes: its wrong tilt counts, too.
  double rotation_rad{};
};

/// @return all NaN until both tags are in the state
PairError pair_error(const PaperRun& run, const PaperRun::At& at, int other) {
  const Pose* first = at.tag(0);
  const Pose* second = at.tag(other);
  if (first == nullptr || second == nullptr) return {Nees::kNone, Nees::kNone, Nees::kNone};
  const Pose seen = first->inverse() * *second;
  const Pose truth = run.data.tag(0)->X_WT.inverse() * run.data.tag(other)->X_WT;
  return {std::abs(seen.p.norm() - truth.p.norm()), (seen.p - truth.p).norm(),
          angle_between(seen.q, truth.q)};
}

/// Root of the mean square over the pairs 0–1 and 0–2 at the end.
double at_end(const PaperRun& run, double PairError::*part) {
  const double a = pair_error(run, run.at.back(), 1).*part;
  const double b = pair_error(run, run.at.back(), 2).*part;
  return std::sqrt(0.5 * (a * a + b * b));
}

/// Of tag 1 when it comes in.
double at_first(const PaperRun& run, double PairError::*part) {
  for (const PaperRun::At& at : run.at) {
    const double value = pair_error(run, at, 1).*part;
    if (!std::isnan(value)) return value;
  }
  return Nees::kNone;
}

PlotPanel tag_panel(const std::string& label, const std::vector<PaperRun>& runs,
                    const PaperOptions& options, int other, double PairError::*part, double unit,
                    double goal) {
  PlotPanel panel{label};
  panel.from_zero = true;
  panel.goal = goal;
  for (std::size_t f = 0; f < options.filters.size(); ++f) {
    panel.lines.push_back({options.filters[f], color_of(options.filters[f]),
                           points_of(runs[f], [&](const PaperRun::At& at) {
                             return unit * pair_error(runs[f], at, other).*part;
                           })});
  }
  return panel;
}

LinePlot tag_plot(const std::vector<PaperRun>& runs, const PaperOptions& options) {
  LinePlot plot{"table: tags 1 and 2 seen from tag 0", "time [s]"};
  plot.panels.push_back(
      tag_panel("distance 0–1 [mm]", runs, options, 1, &PairError::distance_m, kMm, 0.5));
  plot.panels.push_back(
      tag_panel("distance 0–2 [mm]", runs, options, 2, &PairError::distance_m, kMm, 0.5));
  plot.panels.push_back(
      tag_panel("displacement 0–1 [mm]", runs, options, 1, &PairError::displacement_m, kMm, 0.5));
  plot.panels.push_back(
      tag_panel("rotation 0–1 [°]", runs, options, 1, &PairError::rotation_rad, kDegrees, 0.1));
  return plot;
}

}  // namespace

PaperResult table_experiment(const PaperOptions& options) {
  SimulatedDataSetup setup;
  setup.world = "table";
  setup.seconds = options.seconds(60, 20);
  const PaperRuns runs = run_all(options, setup);
  PaperResult result{"table"};
  add_figure(result, {"tag distance error, first", "mm", "small", "-", {}, 2}, runs,
             [](const PaperRun& r) { return kMm * at_first(r, &PairError::distance_m); });
  add_figure(result, {"tag distance error, end", "mm", "< 1", "-", {}, 3, 0.5}, runs,
             [](const PaperRun& r) { return kMm * at_end(r, &PairError::distance_m); });
  add_figure(result, {"tag displacement, end", "mm", "-", "1.2", {}, 3, 0.5}, runs,
             [](const PaperRun& r) { return kMm * at_end(r, &PairError::displacement_m); });
  add_figure(result, {"tag rotation error, first", "°", "0.5", "-", {}, 3}, runs,
             [](const PaperRun& r) { return kDegrees * at_first(r, &PairError::rotation_rad); });
  add_figure(result, {"tag rotation error, end", "°", "0.2", "0.08", {}, 3, 0.1}, runs,
             [](const PaperRun& r) { return kDegrees * at_end(r, &PairError::rotation_rad); });
  add_figure(result, {"position RMSE", "mm", "-", "18.0", {}, 2}, runs, position_rmse_mm);
  add_figure(result, {"position, largest", "mm", "a few cm", "45", {}, 1}, runs, position_worst_mm);
  add_figure(result, {"orientation RMSE", "°", "-", "0.30", {}, 3}, runs, rotation_rmse_deg);
  add_figure(result, {"orientation, largest", "°", "< 3", "-", {}, 2}, runs, rotation_worst_deg);
  add_honesty(result, runs);
  result.plots = {
      tag_plot(runs.front(), options),
      position_plot("table: position in the workspace", runs.front(), options.filters),
      orientation_plot("table: attitude in the workspace", runs.front(), options.filters)};
  return result;
}

}  // namespace fiducap::bench
