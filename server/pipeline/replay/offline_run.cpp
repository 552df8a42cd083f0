#include "pipeline/replay/offline_run.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "base/numeric.hpp"
#include "base/process.hpp"
#include "pipeline/replay/bodies_replay.hpp"

namespace fiducap {
namespace {

constexpr double kFixedPosition_m = 1e-3;
constexpr double kFixedRotation_rad = 1e-3;

/// Of one body, by component.
std::vector<OfflinePart> parts_of(int body_id, const GraphState& graph) {
  std::set<int> components;
  for (const GraphSegment& segment : graph.segments)
    if (segment.raw.body_id == body_id) components.insert(graph.nodes[segment.begin].component);
  components.erase(kInWorkspace);
  std::vector<OfflinePart> parts;
  for (const int component : components) {
    const auto path = path_of(body_id, graph, nullptr, component);
    if (!path) continue;
    OfflinePart part;
    for (const PathPose& pose : *path) part.trajectory.push_back({pose.at, pose.X_WB});
    for (const GraphTag& tag : graph.tags)
      if (tag.component == component)
        part.tags.push_back({tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()});
    parts.push_back(std::move(part));
  }
  std::ranges::stable_sort(parts, [](const OfflinePart& a, const OfflinePart& b) {
    return a.trajectory.front().at < b.trajectory.front().at;
  });
  return parts;
}

/// Collects the results of one body, image by image.
class BodyNotes final {
 public:
  explicit BodyNotes(const OfflineSetup& setup) : setup_(setup) {}

  void note(const SensorSample& sample) {
    const Instant at = time_of(sample);
    if (const auto* frame = std::get_if<CameraFrame>(&sample)) result_.few.note(frame->image);
    if (!first_) first_ = at;
    last_ = std::max(last_.value_or(at), at);
  }
  [[nodiscard]] double data_seconds() const { return first_ ? to_seconds(*last_ - *first_) : 0.0; }

  void take(const BodyUpdate& update) {
    count(update);
    for (const BodyEvent& event : update.events) take(event);
    add_pose(update);
    if (!setup_.sensors.imu) add_to(log_, update.seen);
  }

  /// @param resolves  tags are those of the map, and poses follow
  OfflineResult finish(const BodyPipeline& pipeline, const TagMap& map, bool resolves) {
    finish_statistics(pipeline.statistics());
    place();  // uncontradicted, but too short for PoseTrust
    result_.known = setup_.known;
    result_.doubts = pipeline.doubts();
    result_.extrinsics = pipeline.cameras();
    if (!resolves) pipeline.filter().tag_beliefs(result_.tags);
    add_tags_of(map);
    return std::move(result_);
  }
  [[nodiscard]] const ImageLog& log() const { return log_; }

 private:
  void count(const BodyUpdate& update) {
    const UpdateReport& report = update.report;
    OfflineStatistics& s = result_.statistics;
    ++s.frames;
    s.frames_with_tags += update.seen.tags.empty() ? 0 : 1;
    for (const TagObservation& tag : update.seen.tags) result_.seen.insert(tag.tag_id);
    result_.images.push_back({update.seen.exposed_at, static_cast<int>(update.seen.tags.size())});
    s.tags_rejected += report.tags_rejected;
    s.tags_used += report.tags_used;
    s.nis_sum += report.nis;
    s.nis_dof += report.nis_dof;
    if (report.tags_used > 0) reprojections_px_.push_back(report.reprojection_px);
  }

  void take(const BodyEvent& event) {
    result_.events.push_back(event);
    if (event.kind == BodyEvent::Kind::kReset) begin_generation();
    if (event.kind == BodyEvent::Kind::kGaugeShift) leave_out_generation();
  }

  /// Trusted poses before a reset are kept.
  void begin_generation() {
    forget_unplaced();
    generation_begin_ = placed_poses_;
    placed_ = {};
  }

  void forget_unplaced() {
    result_.trajectory.resize(placed_poses_);
    result_.covariances.resize(placed_poses_);
    unplaced_ = {};
  }

  /// W was redefined. Poses of this generation are less certain in it than their covariances, and
  /// later corrections of the map do not reach them.
  void leave_out_generation() {
    OfflineStatistics& s = result_.statistics;
    s.frames_before_anchoring += placed_.frames + unplaced_.frames;
    s.frames_with_pose -= placed_.frames;
    s.frames_with_tags_and_pose -= placed_.frames_with_tags;
    placed_ = {};
    placed_poses_ = generation_begin_;
    forget_unplaced();
  }

  void add_pose(const BodyUpdate& update) {
    // Without IMU an image without a usable tag does not move the state.
    const std::optional<BodyEstimate>& estimate = update.estimate;
    if (!estimate || estimate->at != update.seen.exposed_at || !estimate->X_WB.p.allFinite())
      return;
    if (!estimate->anchored) {
      ++result_.statistics.frames_before_anchoring;
      return;
    }
    // Kept once they are trusted; contradicted poses never are.
    if (update.doubted && !update.is_untested) return forget_unplaced();
    ++unplaced_.frames;
    unplaced_.frames_with_tags += update.seen.tags.empty() ? 0 : 1;
    // Cameras with the same exposure share one pose, that of the last one.
    const bool again = !result_.trajectory.empty() && result_.trajectory.back().at == estimate->at;
    if (again) {
      result_.trajectory.pop_back();
      result_.covariances.pop_back();
    }
    result_.trajectory.push_back({estimate->at, estimate->X_WB});
    result_.covariances.push_back({estimate->at, estimate->covariance.topLeftCorner<6, 6>()});
    if (!update.doubted) place();
  }

  /// Accepts all poses of this generation so far.
  void place() {
    placed_.frames += unplaced_.frames;
    placed_.frames_with_tags += unplaced_.frames_with_tags;
    result_.statistics.frames_with_pose += unplaced_.frames;
    result_.statistics.frames_with_tags_and_pose += unplaced_.frames_with_tags;
    unplaced_ = {};
    placed_poses_ = result_.trajectory.size();
  }

  void finish_statistics(const PipelineStatistics& pipeline) {
    OfflineStatistics& s = result_.statistics;
    s.data_s = data_seconds();
    s.imu_samples = static_cast<int>(pipeline.imu_samples);
    s.detect_cpu_s = to_seconds(pipeline.detect_cpu);
    s.propagate_cpu_s = to_seconds(pipeline.propagate_cpu);
    s.update_cpu_s = to_seconds(pipeline.update_cpu);
    s.reprojection_median_px = quantile(reprojections_px_, 0.5);
    s.reprojection_p95_px = quantile(std::move(reprojections_px_), 0.95);
    s.merger = pipeline.merger;
  }

  /// Tags that the filter has from the map, or that other bodies have mapped.
  void add_tags_of(const TagMap& map) {
    std::erase_if(result_.tags, [](const TagBelief& belief) {
      return belief.component != TagBelief::kWorkspace;
    });
    const std::size_t own = result_.tags.size();
    for (const MapTag& entry : map.tags) {
      if (entry.state != TagState::kLocal && entry.state != TagState::kCalibrated) continue;
      const auto end = result_.tags.begin() + static_cast<std::ptrdiff_t>(own);
      const bool has = std::any_of(result_.tags.begin(), end, [&](const TagBelief& belief) {
        return belief.tag.tag_id == entry.tag.tag_id;
      });
      if (!has)
        result_.tags.push_back({entry.tag, entry.sightings,
                                instant_from_ns(entry.first_seen_utc_ns),
                                instant_from_ns(entry.last_seen_utc_ns)});
    }
  }

  const OfflineSetup& setup_;
  ImageLog log_;
  std::vector<double> reprojections_px_;
  std::optional<Instant> first_;
  std::optional<Instant> last_;
  struct Images {
    int frames{};
    int frames_with_tags{};
  };
  Images unplaced_;  ///< Of poses that are not yet trusted.
  Images placed_;    ///< Of this generation.
  std::size_t placed_poses_{0};
  std::size_t generation_begin_{0};
  OfflineResult result_;
};

/// Replaces the poses of the filter by those of the batch solution; the former remain beside them.
/// @param covariance  nullptr: nothing is in the workspace, there are no poses
Expected<void> resolve(const OfflineBody& body, const GraphState& graph,
                       const GraphCovariance* covariance, const BatchResult& solved,
                       OfflineResult& result) {
  // Doubts of a filter without odometry do not concern poses by odometry.
  if (solved.is_by_odometry) result.doubts.clear();
  if (const auto doubt = solved.doubts.find(body.id); doubt != solved.doubts.end())
    result.doubts.push_back(doubt->second);
  result.live = std::exchange(result.trajectory, {});
  result.covariances.clear();
  if (covariance != nullptr) {
    const auto path = path_of(body.id, graph, covariance);
    if (!path) return fail(ErrorCode::kInvalid, "the solution is not finite", body.name);
    for (const PathPose& pose : *path) {
      result.trajectory.push_back({pose.at, pose.X_WB});
      result.covariances.push_back({pose.at, pose.covariance});
    }
    result.parts = parts_of(body.id, graph);
    for (const GraphBody& one : graph.bodies) {
      for (std::size_t k = 0; one.id == body.id && k < one.cameras.size(); ++k) {
        result.extrinsics[k].X_BV = one.cameras[k].X_BV;
        if (one.cameras[k].lens_is_open) result.extrinsics[k].lens.offset = one.cameras[k].lens;
      }
    }
    // A survey is a measurement with its sigma.
    for (KnownTag& known : result.known)
      for (const GraphTag& tag : graph.tags)
        if (tag.component == kInWorkspace && tag.tag_id == known.tag_id) known.X_WT = tag.X_WT;
  }
  OfflineStatistics& s = result.statistics;
  s.frames_with_pose = s.frames_with_tags_and_pose = s.frames_before_anchoring = 0;
  auto pose = result.trajectory.begin();
  for (const auto& [at, tags] : result.images) {
    while (pose != result.trajectory.end() && pose->at < at) ++pose;
    if (pose == result.trajectory.end() || pose->at != at) continue;
    ++s.frames_with_pose;
    s.frames_with_tags_and_pose += tags > 0 ? 1 : 0;
  }
  return {};
}

std::vector<BatchBody> batch_of(const std::vector<OfflineBody>& bodies,
                                const std::vector<BodyNotes>& notes) {
  std::vector<BatchBody> batch;
  for (std::size_t i = 0; i < bodies.size(); ++i)
    batch.push_back(
        {bodies[i].id, &bodies[i].setup, &notes[i].log(), bodies[i].setup.odometry.get()});
  return batch;
}

/// Time that is no single body's is divided equally.
void share_cpu(OfflineSession& session) {
  double read_s = session.run_cpu_s;
  for (const OfflineResult& result : session.bodies)
    read_s -= result.statistics.detect_cpu_s + result.statistics.propagate_cpu_s +
              result.statistics.update_cpu_s;
  const auto count = static_cast<double>(session.bodies.size());
  for (OfflineResult& result : session.bodies) {
    result.statistics.read_cpu_s = std::max(0.0, read_s) / count;
    result.statistics.resolve_cpu_s = session.resolve_cpu_s / count;
  }
}

}  // namespace

KnownTag known_tag(const RecordedTag& tag) {
  KnownTag known{tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()};
  known.covariance.diagonal().head<3>().setConstant(tag.position_sigma_m * tag.position_sigma_m);
  known.covariance.diagonal().tail<3>().setConstant(tag.rotation_sigma_rad *
                                                    tag.rotation_sigma_rad);
  return known;
}

void add_known(const OfflineSetup& setup, TagMap& start) {
  for (const KnownTag& known : setup.known) {
    if (start.find(known.tag_id) == nullptr) start.insert({known, TagState::kSurveyed});
  }
  if (!start.reference_tag) start.reference_tag = setup.gauge.reference_tag;
}

OfflineSetup offline_setup(const RecordingInfo& info) {
  OfflineSetup setup;
  setup.odometry = info.odometry;
  setup.sensors.cameras = info.cameras;
  setup.sensors.imu = info.imu;
  if (info.gravity_m_s2) setup.sensors.set_known_gravity(*info.gravity_m_s2);
  setup.tags = tags_of(info);
  setup.gauge.reference_tag = info.reference_tag;
  for (const RecordedTag& tag : info.known_tags) {
    const bool fixed =
        tag.position_sigma_m < kFixedPosition_m && tag.rotation_sigma_rad < kFixedRotation_rad;
    (fixed ? setup.known : setup.priors).push_back(known_tag(tag));
    if (tag.tag_id == info.reference_tag) setup.gauge.X_WT = tag.X_WT;
  }
  return setup;
}

Expected<OfflineSession> run_together(const std::vector<OfflineBody>& bodies, const OfflineMap& map,
                                      const OfflineWatch& watch) {
  const Duration begin = thread_cpu_time();
  const bool alone_without_imu = bodies.size() == 1 && !bodies.front().setup.sensors.imu;
  const bool resolves = !map.keeps_graph && (map.resolve || alone_without_imu);
  std::vector<ReplayedBody> replayed;
  std::vector<BodyNotes> notes;
  TagMap start = map.start;
  for (const OfflineBody& body : bodies) {
    replayed.push_back({body.id, body.name, body.setup, body.source, body.later});
    replayed.back().setup.segments_hold_every_image = resolves;
    notes.emplace_back(body.setup);
    add_known(body.setup, start);
  }
  BodiesReplay replay(std::move(replayed), map.config, std::move(start));
  replay.follow(map.turns, map.refinements);
  if (resolves || map.keeps_graph) replay.refine_after_share();
  replay.listen([&](std::size_t body, const SensorSample& sample) { notes[body].note(sample); });
  OfflineSession session;
  OfflineProgress progress;
  const auto note_events = [&] {
    for (MapEvent& event : replay.map().take_events())
      session.map_events.push_back({progress.at, std::move(event)});
  };
  const auto done = replay.run([&](std::size_t body, const BodyUpdate& update) {
    notes[body].take(update);
    progress = {notes[body].data_seconds(), update.seen.exposed_at + bodies[body].later, 0,
                replay.view().map->tags.size()};
    note_events();
    if (watch) watch(progress);
  });
  if (!done) return tl::unexpected(done.error());
  session.run_cpu_s = to_seconds(thread_cpu_time() - begin);
  session.turns_missed = replay.turns_missed();
  session.agreement = replay.agreement();
  if (resolves || map.keeps_graph) {
    replay.refiner().set_least_sightings(map.least_sightings.value_or(1));
    session.solved = solve_all(replay, batch_of(bodies, notes), [&](int round) {
      progress.round = round;
      if (watch) watch(progress);
    });
  }
  if (map.keeps_graph) {
    note_events();
    session.graph = replay.graph().state();
    session.findings = replay.refiner().findings();
  }
  session.map = *replay.map().snapshot();
  const auto covariance = resolves ? replay.graph().covariance() : std::nullopt;
  for (std::size_t body = 0; body < notes.size(); ++body) {
    session.bodies.push_back(notes[body].finish(replay.pipeline(body), session.map, resolves));
    if (!resolves) continue;
    const auto fault =
        resolve(bodies[body], replay.graph().state(), covariance ? &*covariance : nullptr,
                session.solved, session.bodies.back());
    if (!fault) return tl::unexpected(fault.error());
  }
  session.resolve_cpu_s = to_seconds(thread_cpu_time() - begin) - session.run_cpu_s;
  share_cpu(session);
  return session;
}

Expected<OfflineResult> run_offline(const OfflineSetup& setup, SensorSource& source) {
  auto session = run_together({{1, "body", setup, &source}}, {});
  if (!session) return tl::unexpected(session.error());
  return std::move(session->bodies.front());
}

}  // namespace fiducap
