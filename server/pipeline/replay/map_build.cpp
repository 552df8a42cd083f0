#include "pipeline/replay/map_build.hpp"

#include <algorithm>
#include <numeric>
#include <set>
#include <utility>

#include "base/process.hpp"
#include "mapping/graph/graph_terms.hpp"
#include "pipeline/doubts.hpp"
#include "pipeline/replay/batch_solution.hpp"

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

void count(const BodyUpdate& update, BuiltRecording& recording) {
  ++recording.images;
  recording.images_with_tags += update.seen.tags.empty() ? 0 : 1;
  for (const TagObservation& tag : update.seen.tags) ++recording.seen[tag.tag_id];
}

void note_moved(std::vector<MapEvent> events, MapBuild& build) {
  for (MapEvent& event : events)
    if (event.kind == MapEvent::Kind::kTagQuarantined || event.kind == MapEvent::Kind::kTagMoved ||
        event.kind == MapEvent::Kind::kTagDisputed)
      build.moved.push_back(std::move(event.text));
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

void note_missing_tags(const std::vector<FewImages>& few, const std::vector<MapBuildBody>& bodies,
                       MapBuild& build) {
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const OfflineSetup& setup = bodies[i].body.setup;
    if (build.recordings[i].images_with_tags == 0)
      build.recordings[i].why_no_tag = why_no_tag(few[i].images(), setup.tags, setup.detector);
  }
}

void note_mismatches(std::span<const GraphFinding> findings, const BatchResult& solved,
                     const std::vector<MapBuildBody>& bodies, MapBuild& build) {
  for (const GraphFinding& finding : findings) {
    const auto of = std::ranges::find_if(
        bodies, [&](const MapBuildBody& one) { return one.body.id == finding.body_id; });
    build.mismatches.push_back(
        of == bodies.end()
            ? mismatch_text(finding.what, {})
            : of->body.name + ": " + mismatch_text(finding.what, of->body.setup.sensors.cameras));
  }
  for (const MapBuildBody& one : bodies)
    if (const auto doubt = solved.doubts.find(one.body.id); doubt != solved.doubts.end())
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

Expected<MapBuild> build_map(const std::vector<MapBuildBody>& bodies, const OfflineMap& map,
                             const std::function<void(const MapBuildProgress&)>& progress) {
  const auto later = one_after_the_other(bodies);
  std::vector<ReplayedBody> replayed;
  bool has_imu = false;
  Instant first = Instant::max();
  Instant last = Instant::min();
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const OfflineBody& body = bodies[i].body;
    replayed.push_back({body.id, body.name, body.setup, body.source, later[i]});
    has_imu |= body.setup.sensors.imu.has_value();
    first = std::min(first, bodies[i].first + later[i]);
    last = std::max(last, bodies[i].last + later[i]);
  }
  const double all_s = std::max(1e-3, to_seconds(last - first));
  TagMap start = map.start;
  for (const MapBuildBody& one : bodies) add_known(one.body.setup, start);
  // Segments of filters without IMU are replaced in the end (solve_all).
  MapConfig config = map.config;
  if (!has_imu) config.refine_period_s = 0;
  BodiesReplay replay(std::move(replayed), config, std::move(start));
  replay.refine_after_share();
  MapBuild build;
  build.recordings.resize(bodies.size());
  std::vector<ImageLog> logs(bodies.size());
  std::vector<FewImages> few(bodies.size());
  replay.listen([&](std::size_t body, const SensorSample& sample) {
    if (const auto* frame = std::get_if<CameraFrame>(&sample)) few[body].note(frame->image);
  });
  const Duration begin = thread_cpu_time();
  const auto done = replay.run([&](std::size_t body, const BodyUpdate& update) {
    count(update, build.recordings[body]);
    if (!bodies[body].body.setup.sensors.imu) logs[body].add(update);
    note_moved(replay.map().take_events(), build);
    const double done_s = to_seconds(update.seen.exposed_at + later[body] - first);
    if (progress)
      progress({std::clamp(done_s / all_s, 0.0, 1.0), 0, replay.view().map->tags.size()});
  });
  if (!done) return tl::unexpected(done.error());
  const Duration ran = thread_cpu_time();
  note_missing_tags(few, bodies, build);
  std::vector<BatchBody> batch;
  for (std::size_t i = 0; i < bodies.size(); ++i)
    batch.push_back(
        {bodies[i].body.id, &bodies[i].body.setup, &logs[i], bodies[i].body.setup.odometry.get()});
  replay.refiner().set_least_sightings(map.least_sightings.value_or(1));
  const BatchResult solved = solve_all(replay, batch, [&](int round) {
    if (progress) progress({1.0, round, replay.view().map->tags.size()});
  });
  build.last = solved.last;
  note_moved(replay.map().take_events(), build);
  note_mismatches(replay.refiner().findings(), solved, bodies, build);
  build.run_cpu_s = to_seconds(ran - begin);
  build.solve_cpu_s = to_seconds(thread_cpu_time() - ran);
  build.map = *replay.map().snapshot();
  evaluate(replay.graph().state(), bodies, build);
  return build;
}

}  // namespace fiducap
