#include "pipeline/replay/map_build.hpp"

#include <algorithm>
#include <numeric>
#include <set>
#include <utility>

#include "mapping/graph/graph_terms.hpp"
#include "pipeline/doubts.hpp"

namespace fiducap {
namespace {

// Between recordings that have no time in common.
constexpr Duration kPause = std::chrono::seconds(10);

struct Span {
  Instant first;
  Instant last;
  std::vector<std::size_t> members;
};

/// Groups of overlapping recordings, in the order of each one's first member.
std::vector<Span> spans_of(std::span<const MapBuildBody> bodies) {
  std::vector<std::size_t> by_time(bodies.size());
  std::iota(by_time.begin(), by_time.end(), std::size_t{0});
  std::ranges::stable_sort(
      by_time, [&](std::size_t a, std::size_t b) { return bodies[a].first < bodies[b].first; });
  std::vector<Span> spans;
  for (const std::size_t i : by_time) {
    if (spans.empty() || spans.back().last < bodies[i].first)
      spans.push_back({bodies[i].first, bodies[i].last, {}});
    spans.back().last = std::max(spans.back().last, bodies[i].last);
    spans.back().members.push_back(i);
  }
  std::ranges::sort(spans, [](const Span& a, const Span& b) {
    return *std::ranges::min_element(a.members) < *std::ranges::min_element(b.members);
  });
  return spans;
}

/// Results of the graph beside the map.
void evaluate(const GraphState& graph, const std::vector<MapBuildBody>& bodies, MapBuild& build) {
  std::map<int, MapPart> parts;
  std::map<int, std::set<std::size_t>> members;
  double chi_square = 0;
  int numbers = 0;
  for (const GraphSegment& segment : graph.segments) {
    const auto body = static_cast<std::size_t>(
        std::ranges::find_if(bodies,
                             [&](const auto& one) { return one.body.id == segment.raw.body_id; }) -
        bodies.begin());
    const int component = graph.nodes[segment.begin].component;
    BuiltRecording& recording = build.recordings[body];
    ++recording.segments;
    recording.segments_in_map += component == 0 ? 1 : 0;
    build.fit.sightings += segment.factor.sightings;
    build.fit.outliers += segment.factor.outliers;
    chi_square += 2 * cost_of(segment.factor, error_of(graph, segment));
    numbers += segment.factor.numbers;
    if (component == 0) continue;
    ++parts[component].segments;
    members[component].insert(body);
  }
  const auto level = graph.level.find(0);
  build.is_level = level == graph.level.end() || level->second;
  build.fit.chi_square_per_number = numbers == 0 ? 0.0 : chi_square / numbers;
  for (const GraphTag& tag : graph.tags) {
    const bool is_mapped = build.map.find(tag.tag_id) != nullptr;
    if (tag.component == 0) {
      if (!is_mapped) build.seen_too_seldom[tag.tag_id] = tag.sightings;
      continue;
    }
    const auto part = parts.find(tag.component);
    if (part == parts.end()) continue;
    part->second.tag_ids.push_back(tag.tag_id);
    if (is_mapped) part->second.also_in_map.push_back(tag.tag_id);
  }
  for (auto& [component, part] : parts) {
    part.recordings.assign(members[component].begin(), members[component].end());
    std::ranges::sort(part.tag_ids);
    build.apart.push_back(std::move(part));
  }
}

void note_mismatches(const OfflineSession& session, const std::vector<MapBuildBody>& bodies,
                     MapBuild& build) {
  for (const GraphFinding& finding : session.findings) {
    const auto of = std::ranges::find_if(
        bodies, [&](const MapBuildBody& one) { return one.body.id == finding.body_id; });
    build.mismatches.push_back(
        of == bodies.end()
            ? mismatch_text(finding.what, {})
            : of->body.name + ": " + mismatch_text(finding.what, of->body.setup.sensors.cameras));
  }
  for (const MapBuildBody& one : bodies)
    if (const auto doubt = session.solved.doubts.find(one.body.id);
        doubt != session.solved.doubts.end())
      build.mismatches.push_back(one.body.name + ": " + doubt->second);
}

}  // namespace

std::vector<Duration> one_after_the_other(std::span<const MapBuildBody> bodies) {
  std::vector<Duration> later(bodies.size(), Duration{0});
  std::optional<Instant> end;
  for (const Span& span : spans_of(bodies)) {
    const Duration by = end ? *end + kPause - span.first : Duration{0};
    for (const std::size_t i : span.members) later[i] = by;
    end = span.last + by;
  }
  return later;
}

Expected<MapBuild> build_map(
    const std::vector<MapBuildBody>& bodies, OfflineMap map,
    const std::function<void(double share, const OfflineProgress&)>& watch) {
  const auto later = one_after_the_other(bodies);
  std::vector<OfflineBody> offline;
  Instant first = Instant::max();
  Instant last = Instant::min();
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    offline.push_back(bodies[i].body);
    offline.back().later = later[i];
    first = std::min(first, bodies[i].first + later[i]);
    last = std::max(last, bodies[i].last + later[i]);
  }
  map.keeps_graph = true;
  const double all_s = std::max(1e-3, to_seconds(last - first));
  auto session = run_together(offline, map, [&](const OfflineProgress& at) {
    if (watch) watch(std::clamp(to_seconds(at.at - first) / all_s, 0.0, 1.0), at);
  });
  if (!session) return tl::unexpected(session.error());
  MapBuild build;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    OfflineResult& result = session->bodies[i];
    const OfflineSetup& setup = bodies[i].body.setup;
    BuiltRecording& recording = build.recordings.emplace_back();
    recording.images = result.statistics.frames;
    recording.images_with_tags = result.statistics.frames_with_tags;
    if (recording.images_with_tags == 0)
      recording.why_no_tag = why_no_tag(result.few.images(), setup.tags, setup.detector);
    recording.seen = std::move(result.seen);
  }
  for (const auto& [at, event] : session->map_events)
    if (event.kind == MapEvent::Kind::kTagQuarantined || event.kind == MapEvent::Kind::kTagMoved ||
        event.kind == MapEvent::Kind::kTagDisputed)
      build.moved.push_back(event.text);
  note_mismatches(*session, bodies, build);
  build.last = session->solved.last;
  build.run_cpu_s = session->run_cpu_s;
  build.solve_cpu_s = session->resolve_cpu_s;
  build.map = std::move(session->map);
  evaluate(*session->graph, bodies, build);
  return build;
}

}  // namespace fiducap
