#include "paper/motion_plots.hpp"

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"

namespace fiducap::bench {

namespace {

/// Roll, pitch and yaw (turns about x, y, z, the last one first), degrees.
Eigen::Vector3d angles_of(const Eigen::Quaterniond& q) {
  const Eigen::Matrix3d R = q.toRotationMatrix();
  return kDegrees * Eigen::Vector3d(std::atan2(R(2, 1), R(2, 2)),
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

std::vector<PlotPoint> points_of(const PaperRun& run,
                                 const std::function<double(const PaperRun::At&)>& of) {
  std::vector<PlotPoint> points;
  for (const PaperRun::At& at : run.at) points.emplace_back(at.t_s, of(at));
  return points;
}

LinePlot position_plot(const std::string& title, const std::vector<PaperRun>& runs,
                       const std::vector<std::string>& filters) {
  LinePlot plot{title, "time [s]"};
  const char* const axes[] = {"x [m]", "y [m]", "z [m]"};
  for (int axis = 0; axis < 3; ++axis) {
    PlotPanel panel{axes[axis]};
    panel.lines.push_back(
        {"truth", kTruthColor,
         points_of(runs.front(), [&](const auto& at) { return at.X_WB_true.p(axis); }), false, 4});
    for (std::size_t f = 0; f < filters.size(); ++f) {
      panel.lines.push_back({filters[f], color_of(filters[f]),
                             points_of(runs[f], [&](const auto& at) { return at.X_WB.p(axis); })});
    }
    plot.panels.push_back(std::move(panel));
  }
  plot.panels.push_back(error_panel("error [mm]", runs, filters, &FilterRun::At::position_m, kMm));
  return plot;
}

LinePlot orientation_plot(const std::string& title, const std::vector<PaperRun>& runs,
                          const std::vector<std::string>& filters) {
  LinePlot plot{title, "time [s]"};
  const char* const axes[] = {"roll [°]", "pitch [°]", "yaw [°]"};
  for (int axis = 0; axis < 3; ++axis) {
    PlotPanel panel{axes[axis]};
    panel.lines.push_back(
        {"truth", kTruthColor,
         unwound(points_of(runs.front(),
                           [&](const auto& at) { return angles_of(at.X_WB_true.q)(axis); })),
         false, 4});
    for (std::size_t f = 0; f < filters.size(); ++f) {
      panel.lines.push_back(
          {filters[f], color_of(filters[f]), unwound(points_of(runs[f], [&](const auto& at) {
             return angles_of(at.X_WB.q)(axis);
           }))});
    }
    plot.panels.push_back(std::move(panel));
  }
  plot.panels.push_back(
      error_panel("error [°]", runs, filters, &FilterRun::At::rotation_rad, kDegrees));
  return plot;
}

double position_rmse_mm(const PaperRun& run) {
  return kMm * run.run.scored_after(kSettled_s).rms([](const auto& at) { return at.position_m; });
}

double position_worst_mm(const PaperRun& run) {
  return kMm * worst(run, &FilterRun::At::position_m);
}

double rotation_rmse_deg(const PaperRun& run) {
  return kDegrees *
         run.run.scored_after(kSettled_s).rms([](const auto& at) { return at.rotation_rad; });
}

double rotation_worst_deg(const PaperRun& run) {
  return kDegrees * worst(run, &FilterRun::At::rotation_rad);
}

}  // namespace fiducap::bench
