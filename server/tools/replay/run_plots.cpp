#include "tools/replay/run_plots.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "base/numeric.hpp"
#include "base/text.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr double kMmPerMetre = 1e3;

constexpr std::size_t kMostMessages = 200;

/// Events that are drawn in one colour.
struct EventGroup {
  const char* name;
  const char* color;
  std::vector<BodyEvent::Kind> kinds;
};

const std::vector<EventGroup>& event_groups() {
  using Kind = BodyEvent::Kind;
  static const std::vector<EventGroup> groups{
      {"placed", kPlotColors[2], {Kind::kAnchored, Kind::kRelocalised}},
      {"restarted", kPlotColors[1], {Kind::kReset, Kind::kMotionLost}},
      {"image or tag rejected", kPlotColors[4], {Kind::kImageRejected, Kind::kTagDropped}},
      {"axes or map moved", kPlotColors[5], {Kind::kGaugeShift, Kind::kMapCorrection}},
      {"warning (see messages)",
       kPlotColors[3],
       {Kind::kImuSilent, Kind::kImuBack, Kind::kImuUnusable, Kind::kImuDoubtful,
        Kind::kImuPlausible, Kind::kTurnsDisagree, Kind::kTurnsAgree, Kind::kClockJumped,
        Kind::kMismatch, Kind::kDoubt}}};
  return groups;
}

std::vector<PlotMarks> marks_of(const std::vector<BodyEvent>& events, Instant zero) {
  std::vector<PlotMarks> marks;
  for (const EventGroup& one : event_groups()) {
    PlotMarks group_marks{one.name, one.color, {}};
    for (const BodyEvent& event : events)
      if (std::ranges::find(one.kinds, event.kind) != one.kinds.end())
        group_marks.at.push_back(to_seconds(event.at - zero));
    marks.push_back(std::move(group_marks));
  }
  return marks;
}

/// Distinct from the colour of the tags.
const char* color_of_body(std::size_t body) {
  constexpr std::array<std::size_t, 5> kOrder{0, 2, 3, 5, 4};
  return kPlotColors[kOrder[body % kOrder.size()]];
}

std::string percent(int part, int whole) {
  return whole == 0 ? "–" : fixed(100.0 * part / whole, 1) + " %";
}

LinePlot map_plot_of(std::span<const RunBody> bodies) {
  const TagMap map = run_map(bodies);
  LinePlot plot = map_from_above(map.tags.size());
  PlotPanel& panel = plot.panels.front();
  for (std::size_t i = 0; i < bodies.size(); ++i)
    panel.lines.push_back(
        path_of("path of " + bodies[i].name, color_of_body(i), bodies[i].result->trajectory));
  const auto is_surveyed = [](const MapTag& tag) { return tag.state == TagState::kSurveyed; };
  panel.shapes = {tags_from_above("known tags", kPlotInk, places_in(map, is_surveyed), true),
                  tags_from_above("estimated tags", kPlotColors[1],
                                  places_in(map, std::not_fn(is_surveyed)), true)};
  return plot;
}

PlotLine tags_seen(const OfflineResult& result, const char* color, Instant zero) {
  PlotLine line{"", color, {}, false, 1.1};
  for (const SeenImage& image : result.images)
    line.points.emplace_back(to_seconds(image.at - zero), image.tags);
  return line;
}

LinePlot body_plot(const RunBody& body, std::size_t index, Instant zero) {
  const OfflineResult& result = *body.result;
  const OfflineStatistics& s = result.statistics;
  const char* color = color_of_body(index);
  const Duration longest = longest_step(result.trajectory);
  LinePlot plot{body.name + " over time", "time since the first image, s"};
  plot.subtitle = std::to_string(s.frames_with_pose) + " of " + std::to_string(s.frames) +
                  " images have a pose, " +
                  percent(s.frames_with_tags_and_pose, s.frames_with_tags) +
                  " of those with tags. Sigmas are those of the filter itself, over all "
                  "directions.";
  plot.panel_height = 150;
  for (const PoseHalf half : {PoseHalf::kPosition, PoseHalf::kRotation})
    plot.panels.push_back(sigma_panel(half, color, result.covariances, zero, longest));
  plot.panels.push_back({"tags in the image", {tags_seen(result, color, zero)}});
  plot.panels.back().from_zero = true;
  const auto marks = marks_of(result.events, zero);
  const Instant first = result.images.empty() ? zero : result.images.front().at;
  const Instant last = result.images.empty() ? zero : result.images.back().at;
  for (PlotPanel& panel : plot.panels) {
    panel.spans = {missing_poses(result.trajectory, first, last, zero)};
    panel.marks = marks;
    // Named once.
    if (&panel == &plot.panels.front()) continue;
    for (PlotSpans& spans : panel.spans) spans.name.clear();
    for (PlotMarks& one : panel.marks) one.name.clear();
  }
  return plot;
}

PlotTable figures_of_run(const RunBody& body) {
  const OfflineStatistics& s = body.result->statistics;
  return {
      body.name,
      {{"filter", body.setup->filter},
       {"length", fixed(s.data_s, 1) + " s"},
       {"images", std::to_string(s.frames)},
       {"… with tags", std::to_string(s.frames_with_tags)},
       {"… with a pose", std::to_string(s.frames_with_pose)},
       {"tags known before", std::to_string(body.result->known.size())},
       {"tags mapped", std::to_string(body.result->tags.size())},
       {"reprojection, median", fixed(s.reprojection_median_px, 3) + " px"},
       {"reprojection, 95 %", fixed(s.reprojection_p95_px, 3) + " px"},
       {"NIS per degree of freedom (1: as expected)", fixed(s.nis_per_dof(), 3)},
       {"tags rejected, image by image", percent(s.tags_rejected, s.tags_used + s.tags_rejected)}}};
}

/// Messages of bodies and map, by time.
PlotTable message_table(std::span<const RunBody> bodies, const OfflineSession& session,
                        Instant zero) {
  std::vector<std::pair<Instant, std::string>> messages;
  for (const RunBody& body : bodies)
    for (const BodyEvent& event : body.result->events)
      if (!event.text.empty()) messages.emplace_back(event.at, body.name + ": " + event.text);
  for (const OfflineMapEvent& event : session.map_events)
    if (event.event.kind == MapEvent::Kind::kTagQuarantined ||
        event.event.kind == MapEvent::Kind::kTagMoved)
      messages.emplace_back(event.at, event.event.text);
  std::ranges::stable_sort(messages,
                           [](const auto& a, const auto& b) { return a.first < b.first; });
  PlotTable table{"Messages", {}};
  for (const auto& [at, text] : messages) {
    if (table.rows.size() == kMostMessages) {
      table.rows.emplace_back(
          "…", std::to_string(messages.size() - kMostMessages) + " more are in events.csv");
      break;
    }
    table.rows.emplace_back(fixed(to_seconds(at - zero), 1) + " s", text);
  }
  return table;
}

}  // namespace

Duration longest_step(std::span<const StampedPose> poses) {
  const auto step = median_step(poses);
  return step ? 3 * *step : Duration::max();
}

PlotSpans missing_poses(std::span<const StampedPose> poses, Instant first, Instant last,
                        Instant zero) {
  PlotSpans spans{"no pose", {}};
  const Duration longest = longest_step(poses);
  const auto add = [&](Instant from, Instant to, Duration most) {
    if (to - from > most)
      spans.from_to.emplace_back(to_seconds(from - zero), to_seconds(to - zero));
  };
  if (first > last) return spans;
  if (poses.empty()) {
    add(first, last, Duration{-1});
    return spans;
  }
  add(first, poses.front().at, longest);
  for (std::size_t i = 1; i < poses.size(); ++i) add(poses[i - 1].at, poses[i].at, longest);
  add(poses.back().at, last, longest);
  return spans;
}

PlotLine path_of(const std::string& name, const std::string& color,
                 std::span<const StampedPose> poses) {
  PlotLine line{name, color, {}};
  const Duration longest = longest_step(poses);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (i > 0 && poses[i].at - poses[i - 1].at > longest)
      line.points.emplace_back(kPlotGap, kPlotGap);
    line.points.emplace_back(poses[i].X_WB.p.x(), poses[i].X_WB.p.y());
  }
  return line;
}

PlotShapes tags_from_above(const std::string& name, const std::string& color,
                           std::span<const TagPlace> tags, bool filled) {
  PlotShapes shapes{name, color, {}, filled};
  for (const TagPlace& tag : tags) {
    PlotShapes::Shape shape{{}, std::to_string(tag.tag_id)};
    for (int corner = 0; corner < 4; ++corner) {
      const Eigen::Vector3d p = tag.X_WT * tag_corner(corner, tag.edge_m);
      shape.outline.emplace_back(p.x(), p.y());
    }
    shapes.shapes.push_back(std::move(shape));
  }
  return shapes;
}

LinePlot map_from_above(std::size_t tags) {
  LinePlot plot{"Map from above: " + std::to_string(tags) + (tags == 1 ? " tag" : " tags"),
                "x of the workspace, m",
                {{"y, m"}}};
  plot.subtitle = "Looking along z of the workspace; a tag on a wall is a stroke.";
  plot.equal_axes = true;
  return plot;
}

PlotPanel sigma_panel(PoseHalf half, const std::string& color,
                      std::span<const StampedCovariance> covariances, Instant zero,
                      Duration longest) {
  const bool is_position = half == PoseHalf::kPosition;
  PlotPanel panel{is_position ? "position σ, mm" : "attitude σ, °", {{"", color}}};
  panel.logarithmic = true;
  auto& points = panel.lines.front().points;
  for (std::size_t i = 0; i < covariances.size(); ++i) {
    const auto& [at, P] = covariances[i];
    if (i > 0 && at - covariances[i - 1].at > longest) points.emplace_back(kPlotGap, kPlotGap);
    const double variance =
        is_position ? P.diagonal().head<3>().sum() : P.diagonal().tail<3>().sum();
    points.emplace_back(to_seconds(at - zero),
                        (is_position ? kMmPerMetre : kDegreesPerRadian) * std::sqrt(variance));
  }
  return panel;
}

PlotPage run_plots(std::span<const RunBody> bodies, const OfflineSession& session) {
  PlotPage page;
  Instant zero = Instant::max();  // the first image
  for (const RunBody& body : bodies)
    if (!body.result->images.empty()) zero = std::min(zero, body.result->images.front().at);
  if (zero == Instant::max()) zero = {};
  page.title = "Run of " + comma_list(bodies, [](const RunBody& body) { return body.name; });
  page.plots.push_back(map_plot_of(bodies));
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    page.plots.push_back(body_plot(bodies[i], i, zero));
    page.tables.push_back(figures_of_run(bodies[i]));
    for (const std::string& doubt : bodies[i].result->doubts)
      page.remarks.push_back("Warning, " + bodies[i].name + ": " + doubt);
  }
  PlotTable messages = message_table(bodies, session, zero);
  if (!messages.rows.empty()) page.tables.push_back(std::move(messages));
  return page;
}

}  // namespace fiducap
