// The paper's "Online Extrinsic Estimation": ten recordings of the same room, similar motions.
#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "calibration/extrinsics/camera_imu_calibration.hpp"
#include "paper/motion_plots.hpp"

namespace fiducap::bench {

namespace {

// Mean errors of the start: 5 cm and 5°.
constexpr double kStart_m = 0.05;
constexpr double kStart_rad = 0.0873;
constexpr double kCut_mm = 20;
constexpr double kCut_mrad = 10;

/// The mean result of all runs (the paper's figure is the spread around it).
Pose mean_of(const PaperRuns& runs, std::size_t filter) {
  const Pose& first = runs.front()[filter].at.back().X_BV;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  for (const auto& seed : runs) {
    const Pose& found = seed[filter].at.back().X_BV;
    p += found.p / static_cast<double>(runs.size());
    turn += log_so3(first.q.conjugate() * found.q) / static_cast<double>(runs.size());
  }
  return {first.q * exp_so3(turn), p};
}

void add_repeatability(PaperResult& result, const PaperRuns& runs) {
  PaperFigure position{"position, among the runs", "mm", "15", "-", {}, 2};
  PaperFigure rotation{"rotation, among the runs", "mrad", "3.5", "-", {}, 2};
  for (std::size_t f = 0; f < runs.front().size(); ++f) {
    const Pose mean = mean_of(runs, f);
    position.ours.push_back(spread(
        runs, f, [&](const PaperRun& r) { return kMm * (r.at.back().X_BV.p - mean.p).norm(); }));
    rotation.ours.push_back(spread(runs, f, [&](const PaperRun& r) {
      return 1e3 * angle_between(r.at.back().X_BV.q, mean.q);
    }));
  }
  result.figures.push_back(std::move(position));
  result.figures.push_back(std::move(rotation));
}

/// `fiducap calibrate extrinsics` on the same corners. @return metres and radians off; NaN: failed
std::pair<double, double> solve(const PaperRun& run, const std::string& filter,
                                const PaperOptions& options) {
  OfflineSetup setup;
  setup.sensors = {{run.data.camera}, run.data.imu, run.data.gravity_m_s2};
  setup.sensors.cameras.front().X_BV = run.data.nominal_X_BV;
  setup.tags = run.data.tag_set;
  setup.estimator = options.estimator;
  setup.gauge.reference_tag = run.data.reference_tag;
  setup.filter = filter;
  LoadedSamples samples;
  for (const SensorSample& sample : run.data.samples) {
    if (const auto* imu = std::get_if<ImuSample>(&sample)) {
      samples.imu.push_back(*imu);
    } else {
      samples.frames.push_back(std::get<CornerFrame>(sample));
      samples.tags += static_cast<long>(samples.frames.back().tags.size());
    }
  }
  CalibrationOptions how;
  how.position_sigma_m = run.data.camera.position_sigma_m;
  how.rotation_sigma_rad = run.data.camera.rotation_sigma_rad;
  const auto found = calibrate_camera_imu(setup, samples, how);
  if (!found) return {Nees::kNone, Nees::kNone};
  const Pose& X_BV = found->cameras.front().X_BV;
  return {(X_BV.p - run.data.camera.X_BV.p).norm(), angle_between(X_BV.q, run.data.camera.X_BV.q)};
}

void add_solver(PaperResult& result, const PaperRuns& runs, const PaperOptions& options) {
  const std::size_t filters = options.filters.size();
  std::vector<std::pair<double, double>> off(runs.size() * filters);
  in_parallel(static_cast<int>(off.size()), options.threads, [&](int job) {
    const auto i = static_cast<std::size_t>(job);
    off[i] = solve(runs[i / filters][i % filters], options.filters[i % filters], options);
  });
  const auto index = [&](const PaperRun& run) {
    for (std::size_t i = 0; i < off.size(); ++i) {
      if (&runs[i / filters][i % filters] == &run) return i;
    }
    return std::size_t{0};
  };
  add_figure(result, {"position, fiducap calibrate", "mm", "-", "-", {}, 2, 3.0}, runs,
             [&](const PaperRun& r) { return kMm * off[index(r)].first; });
  add_figure(result, {"rotation, fiducap calibrate", "mrad", "-", "-", {}, 2, 1.0}, runs,
             [&](const PaperRun& r) { return 1e3 * off[index(r)].second; });
}

LinePlot course_plot(const PaperRuns& runs, const PaperOptions& options) {
  LinePlot plot{"extrinsics: error of the running estimate, one line per run", "time [s]"};
  PlotPanel position{"position [mm]"};
  PlotPanel rotation{"rotation [mrad]"};
  position.from_zero = rotation.from_zero = true;
  position.goal = 3;
  rotation.goal = 1;
  for (std::size_t f = 0; f < options.filters.size(); ++f) {
    for (const auto& seed : runs) {
      const PaperRun& run = seed[f];
      const std::string name = &seed == &runs.front() ? options.filters[f] : "";
      const auto add = [&](PlotPanel& panel, const FigureAt& of) {
        panel.lines.push_back({name, color_of(options.filters[f]), points_of(run, of), false, 0.8});
      };
      add(position,
          [&](const auto& at) { return std::min(kCut_mm, kMm * run.extrinsics_position_m(at)); });
      add(rotation, [&](const auto& at) {
        return std::min(kCut_mrad, 1e3 * run.extrinsics_rotation_rad(at));
      });
    }
  }
  plot.panels = {std::move(position), std::move(rotation)};
  return plot;
}

}  // namespace

PaperResult extrinsics_experiment(const PaperOptions& options) {
  SimulatedDataSetup setup;
  setup.world = "table";
  setup.seconds = options.seconds(55, 20);
  setup.extrinsics_sigma_m = kStart_m / std::sqrt(3.0);
  setup.extrinsics_sigma_rad = kStart_rad / std::sqrt(3.0);
  PaperOptions shifted = options;
  shifted.first_seed += 100;  // other motions
  const PaperRuns runs = run_all(shifted, setup);
  PaperResult result{"extrinsics"};
  add_figure(result, {"position, start", "mm", "-", "-", {}, 1}, runs, [](const PaperRun& r) {
    return kMm * (r.data.nominal_X_BV.p - r.data.camera.X_BV.p).norm();
  });
  add_figure(result, {"rotation, start", "mrad", "-", "-", {}, 1}, runs, [](const PaperRun& r) {
    return 1e3 * angle_between(r.data.nominal_X_BV.q, r.data.camera.X_BV.q);
  });
  add_figure(result, {"position, online, end", "mm", "-", "-", {}, 2, 3.0}, runs,
             [](const PaperRun& r) { return kMm * r.extrinsics_position_m(r.at.back()); });
  add_figure(result, {"rotation, online, end", "mrad", "-", "-", {}, 2, 1.0}, runs,
             [](const PaperRun& r) { return 1e3 * r.extrinsics_rotation_rad(r.at.back()); });
  if (runs.size() > 1) add_repeatability(result, runs);
  add_solver(result, runs, options);
  result.plots = {course_plot(runs, options)};
  result.remarks = {"The paper has no truth: its figures are the spread of ten runs."};
  return result;
}

}  // namespace fiducap::bench
