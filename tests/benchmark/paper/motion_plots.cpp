#include "paper/motion_plots.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/pose.hpp"

namespace fiducap::bench {

namespace {

/// Roll, pitch and yaw (turns about x, y, z, the last one first), degrees.
Eigen::Vector3d angles_of(const Eigen::Quaterniond& q) {
  const Eigen::Matrix3d R = q.toRotationMatrix();
  return kDegreesPerRadian * Eigen::Vector3d(std::atan2(R(2, 1), R(2, 2)),
                                             std::asin(std::clamp(-R(2, 0), -1.0, 1.0)),
                                             std::atan2(R(1, 0), R(0, 0)));
}

/// Breaks the line where an angle jumps from 180 to −180.
std::vector<PlotPoint> unwound(std::vector<PlotPoint> points) {
  std::vector<PlotPoint> out;
  for (const PlotPoint& p : points) {
    if (!out.empty() && std::abs(p.second - out.back().second) > 180)
      out.emplace_back(p.first, Nees::kNone);
    out.push_back(p);
  }
  return out;
}

double worst(const PaperRun& run, double FilterRun::At::*error) {
  double most = 0;
  for (const FilterRun::At& at : run.run.scored_after(kSettled_s).at)
    most = std::max(most, at.*error);
  return most;
}

/// Errors of every image, by time.
PlotPanel error_panel(const std::string& label, const std::vector<PaperRun>& runs,
                      const std::vector<std::string>& filters, double FilterRun::At::*error,
                      double unit) {
  PlotPanel panel{label};
  panel.from_zero = true;
  for (std::size_t f = 0; f < filters.size(); ++f) {
    PlotLine line{filters[f], color_of(filters[f])};
    for (const FilterRun::At& at : runs[f].run.at)
      line.points.emplace_back(at.t_s, unit * at.*error);
    panel.lines.push_back(std::move(line));
  }
  return panel;
}

}  // namespace

std::vector<PlotPoint> points_of(const PaperRun& run, const FigureAt& of) {
  std::vector<PlotPoint> points;
  for (const PaperRun::At& at : run.at) points.emplace_back(at.t_s, of(at));
  return points;
}

void add_lines(PlotPanel& panel, const std::vector<PaperRun>& runs,
               const std::vector<std::string>& filters,
               const std::function<double(const PaperRun&, const PaperRun::At&)>& of) {
  for (std::size_t f = 0; f < filters.size(); ++f)
    panel.lines.push_back({filters[f], color_of(filters[f]),
                           points_of(runs[f], [&](const auto& at) { return of(runs[f], at); })});
}

namespace {

/// Three components by all filters and in truth.
LinePlot component_plot(const std::string& title, const std::array<const char*, 3>& labels,
                        const std::vector<PaperRun>& runs, const std::vector<std::string>& filters,
                        const std::function<Eigen::Vector3d(const Pose&)>& of, bool angles) {
  LinePlot plot{title, "time [s]"};
  for (int axis = 0; axis < 3; ++axis) {
    PlotPanel panel{labels[static_cast<std::size_t>(axis)]};
    panel.lines.push_back(
        {"truth", kTruthColor,
         points_of(runs.front(), [&](const auto& at) { return of(at.X_WB_true)(axis); }), false,
         4});
    add_lines(panel, runs, filters, [&](const auto&, const auto& at) { return of(at.X_WB)(axis); });
    if (angles)
      for (PlotLine& line : panel.lines) line.points = unwound(std::move(line.points));
    plot.panels.push_back(std::move(panel));
  }
  return plot;
}

}  // namespace

LinePlot position_plot(const std::string& title, const std::vector<PaperRun>& runs,
                       const std::vector<std::string>& filters) {
  LinePlot plot = component_plot(
      title, {"x [m]", "y [m]", "z [m]"}, runs, filters, [](const Pose& X) { return X.p; }, false);
  plot.panels.push_back(error_panel("error [mm]", runs, filters, &FilterRun::At::position_m, kMm));
  return plot;
}

LinePlot orientation_plot(const std::string& title, const std::vector<PaperRun>& runs,
                          const std::vector<std::string>& filters) {
  LinePlot plot = component_plot(
      title, {"roll [°]", "pitch [°]", "yaw [°]"}, runs, filters,
      [](const Pose& X) { return angles_of(X.q); }, true);
  plot.panels.push_back(
      error_panel("error [°]", runs, filters, &FilterRun::At::rotation_rad, kDegreesPerRadian));
  return plot;
}

void add_motion(PaperResult& result, const PaperRuns& runs,
                const std::array<PaperFigure, 4>& figures) {
  const auto add = [&](std::size_t i, double unit, double FilterRun::At::*error) {
    add_figure(result, figures[i], runs, [=](const PaperRun& run) {
      return unit * run.run.scored_after(kSettled_s).rms([&](const auto& at) { return at.*error; });
    });
    add_figure(result, figures[i + 1], runs,
               [=](const PaperRun& run) { return unit * worst(run, error); });
  };
  add(0, kMm, &FilterRun::At::position_m);
  add(2, kDegreesPerRadian, &FilterRun::At::rotation_rad);
}

}  // namespace fiducap::bench
