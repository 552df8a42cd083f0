#pragma once

#include <gtest/gtest.h>

#include <map>

#include "base/pose.hpp"
#include "mapping/graph/map_graph.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/body_pipeline.hpp"
#include "simulation/filter_run.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/simulation.hpp"
#include "support/results.hpp"

namespace fiducap {

inline constexpr Instant kStart = instant_from_ns(1'000'000'000);

inline simulation::RoomConfig table() {
  simulation::RoomConfig room;
  room.preset = "table";
  return room;
}

struct RobotSetup {
  int id{1};
  std::uint64_t seed{1};
  double seconds{12};
  simulation::RoomConfig room{table()};
  /// False: it stays in its own axes, as its map is empty.
  bool may_define_workspace{true};
  bool has_imu{true};
  std::optional<int> reference_tag{};
  simulation::FaultConfig faults{};
  std::map<int, double> larger{};  ///< Relative size offset of tags, by id.
  double configured_focal{1};      ///< Configured focal length relative to the true one.
};

/// Segments of a body's pipeline for a motion over three tags on a table.
struct Robot {
  explicit Robot(const RobotSetup& setup) : id(setup.id) {
    simulation::SimulatedBodyConfig body;
    const CameraMount mount = forward_mount();
    body.cameras = {mount};
    body.has_imu = setup.has_imu;
    body.camera.images = false;
    body.faults = setup.faults;
    body.trajectory.kind = "table";
    body.trajectory.seed = body.seed = setup.seed;
    body.trajectory.duration_s = setup.seconds;
    auto motion = value_of(simulation::make_trajectory(body.trajectory, table(), mount.X_BV));
    const auto source = value_of(
        simulation::make_simulated_source(setup.room, body, kStart, nullptr, std::move(motion)));
    PipelineSetup pipeline_setup;
    pipeline_setup.sensors.cameras = {mount};
    pipeline_setup.sensors.cameras[0].X_BV = drawn_extrinsics(mount, setup.seed);
    CameraModel& lens = pipeline_setup.sensors.cameras[0].model;
    lens.fu *= setup.configured_focal;
    lens.fv *= setup.configured_focal;
    if (setup.has_imu) pipeline_setup.sensors.imu = body.imu.noise;
    for (const RecordedTag& tag : simulation::tags_of(setup.room)) {
      const auto larger = setup.larger.find(tag.tag_id);
      const double by = larger == setup.larger.end() ? 0 : larger->second;
      pipeline_setup.tags.sizes_m[tag.tag_id] = tag.edge_m / (1 + by);
      truth[tag.tag_id] = tag.X_WT;
    }
    pipeline_setup.gauge.reference_tag = setup.reference_tag;
    pipeline_setup.records_segments = true;
    BodyPipeline pipeline(pipeline_setup);
    const MapView view{std::make_shared<const TagMap>(), setup.may_define_workspace};
    for (auto sample = source->next({}); sample && *sample; sample = source->next({})) {
      (void)pipeline.push(std::move(**sample));
      while (pipeline.next() != nullptr) {
        const BodyUpdate* update = pipeline.take(view);
        if (update == nullptr || !update->segment) continue;
        segments.push_back(*update->segment);
        segments.back().body_id = id;
      }
    }
  }

  int id;
  std::map<int, Pose> truth;
  std::vector<MotionSegment> segments;
};

using Robots = std::vector<Robot>;

/// Two robots with different motions. @param second  but for id and seed
inline Robots two_robots(RobotSetup second = {}) {
  const Robot first(
      {.id = 1, .seed = 3, .seconds = second.seconds, .configured_focal = second.configured_focal});
  second.id = 2;
  second.seed = 4;
  return {first, Robot(second)};
}

/// A graph of the bodies' segments, in the order of the bodies.
inline MapGraph graph_of(const Robots& robots, MapGraph graph = MapGraph{}) {
  for (const Robot& robot : robots)
    for (const MotionSegment& segment : robot.segments) EXPECT_TRUE(graph.add(segment));
  return graph;
}
inline GraphSolution solution_of(const Robots& robots) {
  return value_of(graph_of(robots).solve());
}

/// The yaw and shift that fits tags to other poses of the same tags.
template <class Place>
Pose level_between(const std::vector<GraphTagEstimate>& tags, const Place& place) {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
  for (const GraphTagEstimate& tag : tags) points.emplace_back(tag.X_WT.p, place(tag.tag_id).p);
  return fit_yaw_and_shift(points);
}

struct Score {
  double nees{};  ///< Per degree of freedom, mean over the tags.
  double worst_m{};
};

/// Without the common position and heading of all tags, which are not observable.
inline Score score(const std::vector<GraphTagEstimate>& tags, const std::map<int, Pose>& truth) {
  const Pose level = level_between(tags, [&](int tag_id) { return truth.at(tag_id); });
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = level.rotation();
  Score out;
  for (const GraphTagEstimate& tag : tags) {
    const Vector6d error = pose_error(level * tag.X_WT, truth.at(tag.tag_id));
    const Matrix6d covariance = turn * tag.covariance * turn.transpose();
    out.nees += normalised(error, covariance) / 6 / static_cast<double>(tags.size());
    out.worst_m = std::max(out.worst_m, error.head<3>().norm());
  }
  return out;
}

/// Tags of one component of the graph.
inline std::vector<GraphTagEstimate> in_component(const GraphSolution& solution, int component) {
  std::vector<GraphTagEstimate> out;
  for (const GraphTagEstimate& tag : solution.tags)
    if (tag.component == component) out.push_back(tag);
  return out;
}

/// The map as a server would store it.
inline TagMap stored(const GraphSolution& solution) {
  TagMap map;
  auto known = std::make_shared<KnownMap>();
  known->pairs = solution.pairs;
  for (const GraphTagEstimate& tag : in_component(solution, 0)) {
    known->tags.push_back({tag.tag_id, tag.edge_m, tag.X_WT, tag.covariance});
    map.tags.push_back({.tag = known->tags.back(), .sightings = tag.sightings});
  }
  map.known = std::move(known);
  return map;
}

/// As if the filter had run in other axes.
inline void move_axes(const Pose& G, MotionSegment& segment) {
  for (auto& instance : segment.instances) instance.body = in_other_axes(G, instance.body);
  for (KnownTag& tag : segment.tags) tag.X_WT = G * tag.X_WT;
}

}  // namespace fiducap
