// The paper's data set "dataset_1", and velocities against differences of a marker system's poses.
#include <cmath>
#include <random>

#include "base/pose.hpp"
#include "paper/motion_plots.hpp"

namespace fiducap::bench {

namespace {

using Vector = Eigen::Vector3d;

// A very good marker system with a hand-sized rigid body in the middle of its volume, 1-sigma per
// axis: 0.1 mm, also over a body of 10 cm.
constexpr double kMocap_m = 1e-4;
constexpr double kMocap_rad = 1e-3;

/// Velocity and rate by its poses alone: the difference of two neighbouring ones over the time
/// between them, at its middle.
struct PoseDifference {
  double t_s{};  ///< Since the first sample.
  Vector v_B;
  Vector w_B;
  Vector v_B_true;
  Vector w_B_true;
};

/// Poses at every second IMU instant (100 Hz), so that every difference has the truth of its
/// instant. @pre data has an IMU of even rate
std::vector<PoseDifference> differences_of(const EstimationData& data) {
  std::mt19937_64 random(38);
  std::normal_distribution<double> gauss;
  const auto draw = [&](double sigma) {
    const double x = gauss(random);
    const double y = gauss(random);
    return Vector(sigma * Vector(x, y, gauss(random)));
  };
  std::vector<Instant> instants;
  for (const SensorSample& sample : data.samples)
    if (std::holds_alternative<ImuSample>(sample)) instants.push_back(time_of(sample));
  const auto measured = [&](Instant at) {
    const Pose& X_WB = data.truth_at(at).X_WB;
    return Pose{(X_WB.q * exp_so3(draw(kMocap_rad))).normalized(), X_WB.p + draw(kMocap_m)};
  };
  std::vector<PoseDifference> out;
  const Instant first = time_of(data.samples.front());
  Pose before = measured(instants.front());
  for (std::size_t i = 2; i < instants.size(); i += 2) {
    const Pose after = measured(instants[i]);
    const double dt = to_seconds(instants[i] - instants[i - 2]);
    const TruthSample& middle = data.truth_at(instants[i - 1]);
    const Eigen::Quaterniond q_BW = middle.X_WB.q.conjugate();
    out.push_back({to_seconds(middle.at - first), q_BW * (after.p - before.p) / dt,
                   log_so3(before.q.conjugate() * after.q) / dt, q_BW * middle.v_WB,
                   data.rate_at(middle.at)});
    before = after;
  }
  return out;
}

/// A quantity that a filter estimates and other systems get as differences of poses.
struct Quantity {
  const char* name;
  const char* unit;
  Vector PaperRun::At::*estimate;
  Vector PaperRun::At::*truth;
  Vector PoseDifference::*difference;
  Vector PoseDifference::*difference_truth;
};
constexpr Quantity kVelocity{"Velocity in body axes", "[m/s]",
                             &PaperRun::At::v_B,      &PaperRun::At::v_B_true,
                             &PoseDifference::v_B,    &PoseDifference::v_B_true};
constexpr Quantity kRate{"Body rate",          "[rad/s]",
                         &PaperRun::At::w_B,   &PaperRun::At::w_B_true,
                         &PoseDifference::w_B, &PoseDifference::w_B_true};

double rms_after_start(const std::vector<PlotPoint>& errors) {
  double sum = 0;
  int count = 0;
  for (const auto& [t_s, error] : errors) {
    if (t_s < kSettled_s) continue;
    sum += error * error;
    ++count;
  }
  return count == 0 ? Nees::kNone : std::sqrt(sum / count);
}

/// RMS of the length of the error.
double filter_noise(const PaperRun& run, const Quantity& q) {
  return rms_after_start(
      points_of(run, [&](const auto& at) { return (at.*q.estimate - at.*q.truth).norm(); }));
}

double difference_noise(const PaperRun& run, const Quantity& q) {
  std::vector<PlotPoint> errors;
  for (const auto& d : differences_of(run.data))
    errors.emplace_back(d.t_s, (d.*q.difference - d.*q.difference_truth).norm());
  return rms_after_start(errors);
}

/// Ten seconds of one component, or of its error.
PlotPanel noise_panel(const std::string& label, const std::vector<PaperRun>& runs,
                      const PaperOptions& options, const Quantity& q, int axis, bool error) {
  const auto in_window = [](double t_s) { return t_s >= kSettled_s && t_s <= kSettled_s + 10; };
  const double share = error ? 1 : 0;
  PlotPanel panel{label};
  PlotLine line{"pose differences", "#e57373", {}, false, 0.9};
  for (const auto& d : differences_of(runs.front().data)) {
    const Vector value = d.*q.difference - share * d.*q.difference_truth;
    if (in_window(d.t_s)) line.points.emplace_back(d.t_s, value(axis));
  }
  panel.lines.push_back(std::move(line));
  for (std::size_t f = 0; f < options.filters.size(); ++f) {
    PlotLine ours{options.filters[f], color_of(options.filters[f])};
    for (const auto& at : runs[f].at) {
      const Vector value = at.*q.estimate - share * at.*q.truth;
      if (in_window(at.t_s)) ours.points.emplace_back(at.t_s, value(axis));
    }
    panel.lines.push_back(std::move(ours));
  }
  return panel;
}

/// As the paper's figures of velocities, and below the error of x.
LinePlot noise_plot(const std::vector<PaperRun>& runs, const PaperOptions& options,
                    const Quantity& q) {
  LinePlot plot{std::string("dataset_1: ") + q.name + ", against differences of poses", "time [s]"};
  const char* const axes[] = {"x ", "y ", "z "};
  for (int axis = 0; axis < 3; ++axis)
    plot.panels.push_back(
        noise_panel(axes[axis] + std::string(q.unit), runs, options, q, axis, false));
  plot.panels.push_back(
      noise_panel("error of x " + std::string(q.unit), runs, options, q, 0, true));
  return plot;
}

/// 1 where an image shows no tag, as the paper's figure.
LinePlot detections_plot(const std::vector<PaperRun>& runs, const PaperOptions& options) {
  LinePlot plot{"dataset_1: images without any tag are 1", "time [s]"};
  for (std::size_t f = 0; f < options.filters.size(); ++f) {
    PlotPanel panel{options.filters[f]};
    panel.lines.push_back({"", color_of(options.filters[f]), points_of(runs[f], [](const auto& at) {
                             return at.tags == 0 ? 1 : 0;
                           })});
    plot.panels.push_back(std::move(panel));
  }
  return plot;
}

void add_noise(PaperResult& result, const PaperRuns& runs, const Quantity& q,
               const std::string& name, const std::string& unit, const std::string& authors) {
  add_figure(result, {name + " RMSE", unit, "-", authors, {}, 2}, runs,
             [&](const PaperRun& r) { return 1e3 * filter_noise(r, q); });
  add_figure(result, {name + " RMSE, pose differences", unit, "-", "-", {}, 1}, runs,
             [&](const PaperRun& r) { return 1e3 * difference_noise(r, q); });
  add_figure(result, {name + " noise, differences / ours", "", "> 1", "-", {}, 1}, runs,
             [&](const PaperRun& r) { return difference_noise(r, q) / filter_noise(r, q); });
}

}  // namespace

PaperResult dataset_1_experiment(const PaperOptions& options) {
  SimulatedDataSetup setup;
  setup.world = "sparse";
  setup.exposure_s = 0.01;  // a hall in the evening: tags smear over a module and more
  setup.speed = 1.5;        // "faster than in many robot applications": 2.7 m/s and 3 rad/s at most
  setup.seconds = options.seconds(60, 20);
  const PaperRuns runs = run_all(options, setup);
  PaperResult result{"dataset_1"};
  add_figure(result, {"images without a tag", "%", "almost 20", "20", {}, 1}, runs,
             [](const PaperRun& r) { return 100 * r.share_without_tag(); });
  add_motion(result, runs,
             {{{"position RMSE", "mm", "-", "48.3", {}, 1},
               {"position, largest", "mm", "-", "138", {}, 1},
               {"orientation RMSE", "°", "-", "0.57", {}, 3},
               {"orientation, largest", "°", "9", "-", {}, 2}}});
  add_noise(result, runs, kVelocity, "velocity", "mm/s", "36");
  add_noise(result, runs, kRate, "body rate", "mrad/s", "-");
  add_consistency(result, runs);
  const auto& first = runs.front();
  result.plots = {position_plot("dataset_1: position in the workspace", first, options.filters),
                  orientation_plot("dataset_1: attitude in the workspace", first, options.filters),
                  detections_plot(first, options), noise_plot(first, options, kVelocity),
                  noise_plot(first, options, kRate)};
  result.remarks = {
      "Pose differences: truth at 100 Hz with 0.1 mm and 1 mrad of noise per axis, neighbours "
      "subtracted; ours: at images."};
  return result;
}

}  // namespace fiducap::bench
