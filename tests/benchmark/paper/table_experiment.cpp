// The paper's "Fiducial Estimation Test" and the motion of data set "table"; the simulator's hall.
#include <cmath>

#include "base/pose.hpp"
#include "paper/motion_plots.hpp"

namespace fiducap::bench {

namespace {

/// Error of tag `other`, relative to tag 0.
struct PairError {
  double distance_m{};      ///< The paper's figure: of the distance between the two.
  double displacement_m{};  ///< In tag 0's axes, with the error of its tilt.
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

/// Of tag 1 when it is added.
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
  add_lines(panel, runs, options.filters, [&](const PaperRun& run, const PaperRun::At& at) {
    return unit * pair_error(run, at, other).*part;
  });
  return panel;
}

LinePlot tag_plot(const std::vector<PaperRun>& runs, const PaperOptions& options) {
  LinePlot plot{"table: tags 1 and 2 seen from tag 0", "time [s]"};
  const auto add = [&](const char* label, int other, double PairError::*part, double unit,
                       double goal) {
    plot.panels.push_back(tag_panel(label, runs, options, other, part, unit, goal));
  };
  add("distance 0–1 [mm]", 1, &PairError::distance_m, kMm, 0.5);
  add("distance 0–2 [mm]", 2, &PairError::distance_m, kMm, 0.5);
  add("displacement 0–1 [mm]", 1, &PairError::displacement_m, kMm, 0.5);
  add("rotation 0–1 [°]", 1, &PairError::rotation_rad, kDegreesPerRadian, 0.1);
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
  add_figure(
      result, {"tag rotation error, first", "°", "0.5", "-", {}, 3}, runs,
      [](const PaperRun& r) { return kDegreesPerRadian * at_first(r, &PairError::rotation_rad); });
  add_figure(
      result, {"tag rotation error, end", "°", "0.2", "0.08", {}, 3, 0.1}, runs,
      [](const PaperRun& r) { return kDegreesPerRadian * at_end(r, &PairError::rotation_rad); });
  add_motion(result, runs,
             {{{"position RMSE", "mm", "-", "18.0", {}, 2},
               {"position, largest", "mm", "a few cm", "45", {}, 1},
               {"orientation RMSE", "°", "-", "0.30", {}, 3},
               {"orientation, largest", "°", "< 3", "-", {}, 2}}});
  add_consistency(result, runs);
  result.plots = {
      tag_plot(runs.front(), options),
      position_plot("table: position in the workspace", runs.front(), options.filters),
      orientation_plot("table: attitude in the workspace", runs.front(), options.filters)};
  return result;
}

PaperResult hall_experiment(const PaperOptions& options) {
  SimulatedDataSetup setup;
  setup.world = "hall";
  setup.seconds = options.seconds(60, 20);
  const PaperRuns runs = run_all(options, setup);
  PaperResult result{"hall"};
  add_figure(result, {"position RMSE", "mm", "-", "-", {}, 2}, runs, [](const PaperRun& r) {
    return kMm * r.run.scored_after(kSettled_s).rms([](const auto& at) { return at.position_m; });
  });
  add_consistency(result, runs);
  return result;
}

}  // namespace fiducap::bench
