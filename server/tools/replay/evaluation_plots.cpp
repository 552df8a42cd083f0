#include <algorithm>
#include <array>
#include <cmath>

#include "base/numeric.hpp"
#include "base/text.hpp"
#include "tools/replay/run_plots.hpp"

namespace fiducap {
namespace {

constexpr double kMm = 1e3;
constexpr double kBandSigmas = 3;
constexpr const char* kTimeLabel = "time since the first image, s";

const StampedCovariance* covariance_at(std::span<const StampedCovariance> covariances, Instant at) {
  const auto found = std::ranges::lower_bound(covariances, at, {}, &StampedCovariance::at);
  return found != covariances.end() && found->at == at ? &*found : nullptr;
}

/// Error of the position or of the attitude, component by component, with band.
class ErrorPanels final {
 public:
  ErrorPanels(const EvaluationTraces& traces, std::span<const StampedCovariance> covariances,
              PoseHalf half, Duration longest)
      : half_(half), R_AW_(traces.X_WA.rotation().transpose()) {
    const char* components[]{"x", "y", "z"};
    for (std::size_t k = 0; k < 3; ++k) {
      panels_[k].y_label = std::string(components[k]) + (is_position() ? ", mm" : ", °");
      panels_[k].lines.push_back({"error", kPlotColors[0], {}});
      if (!covariances.empty()) panels_[k].areas.push_back({"± 3 σ", kPlotColors[4], {}});
    }
    panels_[3].y_label = is_position() ? "length, mm" : "angle, °";
    panels_[3].from_zero = true;
    panels_[3].lines.push_back({"", kPlotColors[0], {}});
    for (std::size_t i = 0; i < traces.differences.size(); ++i) {
      const PoseDifference& one = traces.differences[i];
      const double t_s = to_seconds(one.at - traces.first_image);
      if (i > 0 && one.at - traces.differences[i - 1].at > longest) break_curves();
      add(one, t_s, covariance_at(covariances, one.at));
    }
  }

  /// "99.1 % within 3 sigma"; empty without a band.
  [[nodiscard]] std::string share_text() const {
    if (compared_ == 0) return {};
    return fixed(100.0 * within_ / compared_, 1) +
           " % of the components are within the filter's own 3 sigma. 99.7 % is expected if the "
           "reference tag is exact: its error in the map is part of the curves.";
  }
  [[nodiscard]] std::vector<PlotPanel> take_panels() {
    for (std::size_t k = 1; k < 3; ++k) {
      panels_[k].lines.front().name.clear();
      for (PlotArea& area : panels_[k].areas) area.name.clear();
    }
    return {std::make_move_iterator(panels_.begin()), std::make_move_iterator(panels_.end())};
  }

 private:
  [[nodiscard]] bool is_position() const { return half_ == PoseHalf::kPosition; }

  void break_curves() {
    for (PlotPanel& panel : panels_) {
      panel.lines.front().points.emplace_back(kPlotGap, kPlotGap);
      for (PlotArea& area : panel.areas) area.slices.push_back({kPlotGap, kPlotGap, kPlotGap});
    }
  }

  void add(const PoseDifference& one, double t_s, const StampedCovariance* covariance) {
    const double unit = is_position() ? kMm : kDegreesPerRadian;
    const Eigen::Vector3d error = unit * (is_position() ? one.p : one.rotation);
    for (std::size_t k = 0; k < 3; ++k)
      panels_[k].lines.front().points.emplace_back(t_s, error[static_cast<Eigen::Index>(k)]);
    panels_[3].lines.front().points.emplace_back(t_s, error.norm());
    if (covariance == nullptr) return;
    const int at = is_position() ? 0 : 3;
    const Eigen::Matrix3d P_W = covariance->covariance.block<3, 3>(at, at);
    const Eigen::Matrix3d P_A = R_AW_ * P_W * R_AW_.transpose();
    for (std::size_t k = 0; k < 3; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const double bound = kBandSigmas * unit * std::sqrt(std::max(0.0, P_A(i, i)));
      panels_[k].areas.front().slices.push_back({t_s, -bound, bound});
      ++compared_;
      within_ += std::abs(error[i]) <= bound ? 1 : 0;
    }
  }

  PoseHalf half_;
  Eigen::Matrix3d R_AW_;
  std::array<PlotPanel, 4> panels_;
  int compared_{0};
  int within_{0};
};

/// Where poses are missing, and what is left out of the numbers.
void shade(const Evaluation& e, const PlotSpans& missing, LinePlot& plot) {
  const EvaluationTraces& traces = e.traces;
  for (PlotPanel& panel : plot.panels) {
    panel.spans = {missing};
    if (&panel != &plot.panels.front()) panel.spans.front().name.clear();
    if (traces.settled_at && *traces.settled_at > traces.first_image)
      panel.bands = {
          {0, to_seconds(std::min(*traces.settled_at, traces.last_image) - traces.first_image),
           &panel == &plot.panels.front() ? "left out" : ""}};
  }
}

LinePlot error_plot(const Evaluation& e, const RunResults& run,
                    std::span<const StampedCovariance> covariances, const PlotSpans& missing,
                    PoseHalf half) {
  const PoseErrors& errors = *e.pose;
  const bool is_position = half == PoseHalf::kPosition;
  const auto number = [&](double m, double rad) {
    return is_position ? fixed(kMm * m, 2) + " mm" : fixed(kDegreesPerRadian * rad, 3) + "°";
  };
  LinePlot plot;
  plot.title = std::string(is_position ? "Position" : "Attitude") + " error against " +
               (e.against == Evaluation::Against::kTruth ? "truth" : "another program") + ": " +
               number(errors.position_rmse_m, errors.rotation_rmse_rad) + " RMSE, worst " +
               number(errors.position_max_m, errors.rotation_max_rad);
  plot.x_label = kTimeLabel;
  plot.panel_height = 120;
  ErrorPanels panels(e.traces, covariances, half, longest_step(run.trajectory));
  plot.subtitle = "In the axes of tag " + std::to_string(*e.reference_tag) + ", nothing fitted, " +
                  std::to_string(errors.samples) + " poses, the first 5 s left out. " +
                  panels.share_text();
  plot.panels = panels.take_panels();
  shade(e, missing, plot);
  return plot;
}

LinePlot sigma_plot(const Evaluation& e, const RunResults& run,
                    std::span<const StampedCovariance> covariances, const PlotSpans& missing) {
  LinePlot plot{"Sigmas of the filter", kTimeLabel};
  plot.subtitle = "1 sigma over all directions, as estimated by the filter.";
  const Duration longest = longest_step(run.trajectory);
  for (const PoseHalf half : {PoseHalf::kPosition, PoseHalf::kRotation}) {
    plot.panels.push_back(
        sigma_panel(half, kPlotColors[0], covariances, e.traces.first_image, longest));
    plot.panels.back().spans = {missing};
  }
  plot.panels.back().spans.front().name.clear();
  return plot;
}

LinePlot map_plot(const Evaluation& e, const RunResults& run) {
  LinePlot plot = map_from_above(run.map.size());
  if (e.map && e.map->samples > 0)
    plot.title += ", " + fixed(kMm * e.map->position_rmse_m, 2) + " mm RMSE";
  const bool is_truth = e.against == Evaluation::Against::kTruth;
  PlotPanel& panel = plot.panels.front();
  if (!e.traces.reference_path.empty()) {
    panel.lines.push_back(path_of(is_truth ? "true path" : "path of the other program", kPlotGray,
                                  e.traces.reference_path));
    panel.lines.back().width = 3;
  }
  panel.lines.push_back(path_of("path", kPlotColors[0], run.trajectory));
  panel.shapes.push_back(tags_from_above("tags", kPlotColors[1], run.map, true));
  if (!e.traces.reference_map.empty())
    panel.shapes.push_back(tags_from_above(is_truth ? "true tags" : "tags of the other program",
                                           kPlotInk, e.traces.reference_map, false));
  return plot;
}

/// @param width_px  of a column; the last one holds all larger values
PlotColumns histogram(const std::string& name, const char* color, const std::vector<double>& values,
                      double width_px, std::size_t count) {
  PlotColumns columns{name, color, {}};
  for (std::size_t k = 0; k < count; ++k)
    columns.columns.push_back(
        {static_cast<double>(k) * width_px, static_cast<double>(k + 1) * width_px, 0});
  for (const double value : values) {
    const double place = std::max(0.0, value / width_px);
    const std::size_t k =
        place < static_cast<double>(count) ? static_cast<std::size_t>(place) : count - 1;
    columns.columns[k].height += 100.0 / static_cast<double>(values.size());
  }
  return columns;
}

LinePlot reprojection_plot(const Evaluation& e) {
  const ReprojectionSummary& r = e.reprojection;
  constexpr std::size_t kColumns = 40;
  constexpr double kMostOfThem = 0.99;
  const EvaluationTraces& traces = e.traces;
  LinePlot plot{"Reprojection error: median " + fixed(r.median_px, 3) + " px, 95 % below " +
                    fixed(r.p95_px, 3) + " px",
                "root mean square distance of a tag's four corners, px"};
  plot.subtitle = std::to_string(r.scored) + " of " + std::to_string(r.detections) +
                  " detections; the last column holds all larger ones. Coverage " +
                  fixed(100 * r.coverage(), 1) + " % of the images with tags.";
  PlotPanel panel{"share of detections, %"};
  panel.from_zero = true;
  const double reach = std::max(quantile(traces.reprojection_px, kMostOfThem),
                                quantile(traces.truth_reprojection_px, kMostOfThem));
  if (reach > 0) {
    panel.columns.push_back(histogram("of the run", kPlotColors[0], traces.reprojection_px,
                                      reach / kColumns, kColumns + 1));
    if (!traces.truth_reprojection_px.empty()) {
      panel.columns.push_back(histogram(
          e.against == Evaluation::Against::kTruth ? "of the truth itself" : "of the other program",
          kPlotColors[1], traces.truth_reprojection_px, reach / kColumns, kColumns + 1));
      panel.columns.back().filled = false;
    }
  }
  plot.panels = {std::move(panel)};
  return plot;
}

void add_errors(const std::string& name, const std::optional<PoseErrors>& errors,
                PlotTable& table) {
  if (errors && errors->samples > 0) table.rows.emplace_back(name, text_of(*errors));
}

PlotTable figures_of_evaluation(const Evaluation& e) {
  const ReprojectionSummary& r = e.reprojection;
  PlotTable table{"Figures", {}};
  add_errors("pose", e.pose, table);
  add_errors("levelled pose", e.levelled_pose, table);
  add_errors("pose in W", e.world_pose, table);
  add_errors("tag map", e.map, table);
  add_errors("map, fitted", e.fitted_map, table);
  add_errors("extrinsics", e.extrinsics, table);
  table.rows.emplace_back("reprojection, median", fixed(r.median_px, 3) + " px");
  table.rows.emplace_back("reprojection, 95 %", fixed(r.p95_px, 3) + " px");
  table.rows.emplace_back("images with tags", std::to_string(r.frames_with_tags));
  table.rows.emplace_back("… with a pose", std::to_string(r.frames_with_tags_and_pose) + " (" +
                                               fixed(100 * r.coverage(), 2) + " %)");
  return table;
}

}  // namespace

PlotPage evaluation_plots(const std::string& title, const RunResults& run,
                          std::span<const StampedCovariance> covariances, const Evaluation& e) {
  PlotPage page;
  page.title = title;
  const EvaluationTraces& traces = e.traces;
  const PlotSpans missing =
      missing_poses(run.trajectory, traces.first_image, traces.last_image, traces.first_image);
  if (e.pose && e.pose->samples > 0) {
    for (const PoseHalf half : {PoseHalf::kPosition, PoseHalf::kRotation})
      page.plots.push_back(error_plot(e, run, covariances, missing, half));
  } else {
    page.remarks.emplace_back("The recording has neither truth nor reference poses.");
    if (!covariances.empty()) page.plots.push_back(sigma_plot(e, run, covariances, missing));
  }
  page.plots.push_back(map_plot(e, run));
  page.plots.push_back(reprojection_plot(e));
  page.tables.push_back(figures_of_evaluation(e));
  return page;
}

}  // namespace fiducap
