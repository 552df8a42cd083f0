#include "tools/replay/run_plots.hpp"

#include <algorithm>
#include <array>

#include "base/text.hpp"
#include "tools/replay/pose_plots.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMostSaid = 200;

/// What belongs together of all that may happen.
struct HappeningClass {
  const char* name;
  const char* color;
  std::vector<BodyEvent::Kind> kinds;
};

const std::vector<HappeningClass>& happening_classes() {
  using Kind = BodyEvent::Kind;
  static const std::vector<HappeningClass> classes{
      {"placed", kPlotColors[2], {Kind::kAnchored, Kind::kRelocalised}},
      {"begun anew", kPlotColors[1], {Kind::kReset, Kind::kMotionLost}},
      {"image or tag rejected", kPlotColors[4], {Kind::kImageRejected, Kind::kTagDropped}},
      {"axes or map moved", kPlotColors[5], {Kind::kGaugeShift, Kind::kMapCorrection}},
      {"something is off (below)",
       kPlotColors[3],
       {Kind::kImuSilent, Kind::kImuBack, Kind::kImuUnusable, Kind::kImuDoubtful,
        Kind::kImuPlausible, Kind::kTurnsDisagree, Kind::kTurnsAgree, Kind::kClockJumped,
        Kind::kMismatch, Kind::kDoubt}}};
  return classes;
}

std::vector<PlotMarks> marks_of(const std::vector<BodyEvent>& events, Instant zero) {
  std::vector<PlotMarks> marks;
  for (const HappeningClass& one : happening_classes()) {
    PlotMarks of_class{one.name, one.color, {}};
    for (const BodyEvent& event : events)
      if (std::find(one.kinds.begin(), one.kinds.end(), event.kind) != one.kinds.end())
        of_class.at.push_back(to_seconds(event.at - zero));
    marks.push_back(std::move(of_class));
  }
  return marks;
}

/// Not the colour of the tags.
const char* color_of_body(std::size_t body) {
  constexpr std::array<std::size_t, 5> kOrder{0, 2, 3, 5, 4};
  return kPlotColors[kOrder[body % kOrder.size()]];
}

std::vector<TagPlace> places_in(const TagMap& map, bool surveyed) {
  std::vector<TagPlace> places;
  for (const MapTag& entry : map.tags)
    if ((entry.state == TagState::kSurveyed) == surveyed)
      places.push_back({entry.tag.tag_id, entry.tag.edge_m, entry.tag.X_WT});
  return places;
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
        way_of("way of " + bodies[i].name, color_of_body(i), bodies[i].result->trajectory));
  panel.shapes = {tags_from_above("known tags", kSvgInk, places_in(map, true), true),
                  tags_from_above("estimated tags", kPlotColors[1], places_in(map, false), true)};
  return plot;
}

PlotLine tags_seen(const OfflineResult& result, const char* color, Instant zero) {
  PlotLine line{"", color, {}, false, 1.1};
  for (const SeenImage& image : result.images)
    line.points.emplace_back(to_seconds(image.at - zero), image.tags);
  return line;
}

LinePlot course_of(const RunBody& body, std::size_t index, Instant zero) {
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
  for (const PoseHalf half : {PoseHalf::kPosition, PoseHalf::kRotation}) {
    plot.panels.push_back(sigma_panel(half));
    plot.panels.back().lines = {sigma_line("", color, result.covariances, half, zero, longest)};
  }
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
       {"NIS per degree of freedom (1: as the noises say)", fixed(s.nis_per_dof(), 3)},
       {"tags rejected, image by image", percent(s.tags_rejected, s.tags_used + s.tags_rejected)}}};
}

/// Everything that came with words, of bodies and map, by time.
PlotTable said_table(std::span<const RunBody> bodies, const OfflineSession& session, Instant zero) {
  std::vector<std::pair<Instant, std::string>> said;
  for (const RunBody& body : bodies)
    for (const BodyEvent& event : body.result->events)
      if (!event.text.empty()) said.emplace_back(event.at, body.name + ": " + event.text);
  for (const OfflineMapEvent& event : session.map_events)
    if (event.event.kind == MapEvent::Kind::kTagQuarantined ||
        event.event.kind == MapEvent::Kind::kTagMoved)
      said.emplace_back(event.at, event.event.text);
  std::stable_sort(said.begin(), said.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  PlotTable table{"What was said", {}};
  for (const auto& [at, text] : said) {
    if (table.rows.size() == kMostSaid) {
      table.rows.emplace_back("…",
                              std::to_string(said.size() - kMostSaid) + " more are in events.csv");
      break;
    }
    table.rows.emplace_back(fixed(to_seconds(at - zero), 1) + " s", text);
  }
  return table;
}

Instant first_image_of(std::span<const RunBody> bodies) {
  Instant first = Instant::max();
  for (const RunBody& body : bodies)
    if (!body.result->images.empty()) first = std::min(first, body.result->images.front().at);
  return first == Instant::max() ? Instant{} : first;
}

}  // namespace

PlotPage run_plots(std::span<const RunBody> bodies, const OfflineSession& session) {
  PlotPage page;
  const Instant zero = first_image_of(bodies);
  for (const RunBody& body : bodies)
    page.title += (page.title.empty() ? "Run of " : ", ") + body.name;
  page.plots.push_back(map_plot_of(bodies));
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    page.plots.push_back(course_of(bodies[i], i, zero));
    page.tables.push_back(figures_of_run(bodies[i]));
    for (const std::string& doubt : bodies[i].result->doubts)
      page.remarks.push_back("Warning, " + bodies[i].name + ": " + doubt);
  }
  PlotTable said = said_table(bodies, session, zero);
  if (!said.rows.empty()) page.tables.push_back(std::move(said));
  return page;
}

}  // namespace fiducap
