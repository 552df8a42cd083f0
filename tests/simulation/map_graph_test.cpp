// The map graph over segments of simulated bodies, from their own pipelines.
#include <gtest/gtest.h>

#include "simulation/graph_robot.hpp"

namespace fiducap {
namespace {

TEST(MapGraphSimulation, OneBodyEstimatesTagsConsistently) {
  constexpr int kSeeds = 12;
  constexpr double kFewSigmas_m = 0.003;  // of half a millimetre
  double nees = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const Robot robot({.seed = seed});
    const GraphSolution solution = solution_of({robot});
    ASSERT_EQ(solution.tags.size(), 3u);
    const Score one = score(solution.tags, robot.truth);
    EXPECT_LT(one.worst_m, kFewSigmas_m);
    EXPECT_LT(one.nees, 3);
    EXPECT_NEAR(solution.cost / solution.numbers, 0.95, 0.1) << "corner noise as configured";
    nees += one.nees / kSeeds;
  }
  EXPECT_GT(nees, 0.5);
  EXPECT_LT(nees, 1.6);
}

TEST(MapGraphSimulation, BodyWithoutImuEstimatesTags) {
  const Robot robot({.seed = 1, .has_imu = false});
  const GraphSolution solution = solution_of({robot});
  ASSERT_EQ(solution.tags.size(), 3u);
  // Not level: poses are compared relative to the first tag.
  const Pose& first = solution.tags[0].X_WT;
  for (const GraphTagEstimate& tag : solution.tags) {
    const Pose found = first.inverse() * tag.X_WT;
    const Pose expected = robot.truth.at(0).inverse() * robot.truth.at(tag.tag_id);
    EXPECT_LT((found.p - expected.p).norm(), 0.003);
    EXPECT_LT(angle_between(found.q, expected.q), 0.015);
  }
}

TEST(MapGraphSimulation, CountsSightingsAndGivesPairs) {
  const Robot robot({.seed = 2});
  const GraphSolution solution = solution_of({robot});
  std::map<int, int> sightings;
  for (const MotionSegment& segment : robot.segments)
    for (const auto& instance : segment.instances)
      for (const SegmentImage& image : instance.images)
        for (const SegmentSighting& s : image.tags) ++sightings[s.seen.tag_id];
  for (const GraphTagEstimate& tag : solution.tags)
    EXPECT_EQ(tag.sightings, sightings[tag.tag_id]) << tag.tag_id;
  EXPECT_EQ(solution.pairs.size(), 3u) << "each two of three";
}

TEST(MapGraphSimulation, BodyInOtherAxesJoinsByCommonTags) {
  const Robots robots = two_robots({.may_define_workspace = false});
  ASSERT_TRUE(robots[0].segments.front().anchored);
  ASSERT_FALSE(robots[1].segments.front().anchored);
  MapGraph graph = graph_of(robots);
  for (const GraphNode& node : graph.state().nodes) EXPECT_EQ(node.component, 0);
  const auto solution = value_of(graph.solve());
  ASSERT_EQ(in_component(solution, 0).size(), 3u);
  EXPECT_EQ(solution.tags.size(), 3u) << "none is there twice";
  const Score together = score(solution.tags, robots[0].truth);
  EXPECT_LT(together.worst_m, 0.003);
  EXPECT_LT(together.nees, 3);
}

TEST(MapGraphSimulation, BodyKeepsItsTagsWhenItFindsTheWorkspace) {
  Robot robot({.seed = 4, .may_define_workspace = false});
  // Half way its filter finds the workspace.
  const Pose G{exp_so3({0, 0, 0.7}), {1, 2, 3}};
  for (std::size_t i = robot.segments.size() / 2; i < robot.segments.size(); ++i) {
    MotionSegment& segment = robot.segments[i];
    segment.anchored = true;
    move_axes(G, segment);
  }
  const Pose expected = robot.segments.back().tags.front().X_WT;
  MapGraph graph = graph_of({robot});
  for (const GraphNode& node : graph.state().nodes) EXPECT_EQ(node.component, 0);
  const auto solution = value_of(graph.solve());
  ASSERT_EQ(solution.tags.size(), 3u);
  EXPECT_LT(score(solution.tags, robot.truth).worst_m, 0.003);
  constexpr double kFirstSight_m = 0.05;  // W is not defined: tags keep their initial poses
  EXPECT_LT((solution.tags.front().X_WT.p - expected.p).norm(), kFirstSight_m);
}

TEST(MapGraphSimulation, TwoBodiesWithoutWorkspaceAreOneComponent) {
  const Robots robots{Robot({.id = 1, .seed = 3, .may_define_workspace = false}),
                      Robot({.id = 2, .seed = 4, .may_define_workspace = false})};
  MapGraph graph = graph_of(robots);
  const int component = graph.state().nodes.front().component;
  EXPECT_NE(component, 0);
  for (const GraphNode& node : graph.state().nodes) EXPECT_EQ(node.component, component);
  ASSERT_EQ(graph.state().tags.size(), 3u);
  // Before the first solution, the second one is placed by its tags.
  std::map<int, Pose> places;
  for (const GraphTag& tag : graph.state().tags) places[tag.tag_id] = tag.X_WT;
  for (const auto& [tag_id, X] : places) {
    const double found = (X.p - places.begin()->second.p).norm();
    const double expected = (robots[0].truth.at(tag_id).p - robots[0].truth.at(0).p).norm();
    EXPECT_NEAR(found, expected, 0.02);
  }
  EXPECT_FALSE(graph.solve()) << "no tag defines W";
}

TEST(MapGraphSimulation, TagWithContradictingTiltStaysApart) {
  constexpr double kTilt_rad = 0.25;
  simulation::RoomConfig other;
  other.preset = "custom";
  for (RecordedTag tag : simulation::tags_of(table())) {
    if (tag.tag_id == 0) {
      tag.X_WT.q = tag.X_WT.q * exp_so3({kTilt_rad, 0, 0});
    } else {
      tag.tag_id += 10;
    }
    other.tags.push_back(tag);
  }
  const Robots robots = two_robots({.room = other, .may_define_workspace = false});
  const GraphSolution solution = solution_of(robots);
  const auto here = in_component(solution, 0);
  EXPECT_EQ(here.size(), 3u);
  EXPECT_EQ(solution.tags.size(), 6u) << "each has the tag in its own place";
  EXPECT_LT(score(here, robots[0].truth).worst_m, 0.003);
  EXPECT_LT(solution.cost / solution.numbers, 1.1) << "nothing contradicts within a component";
}

TEST(MapGraphSimulation, OrderOfBodiesDoesNotMatter) {
  constexpr double kSame = 1e-6;  // m and rad
  Robots robots = two_robots({.may_define_workspace = false});
  const GraphSolution one = solution_of(robots);
  std::swap(robots[0], robots[1]);
  const GraphSolution other = solution_of(robots);
  ASSERT_EQ(one.tags.size(), other.tags.size());
  std::map<int, Pose> places;
  for (const GraphTagEstimate& tag : one.tags) places[tag.tag_id] = tag.X_WT;
  const Pose level = level_between(other.tags, [&](int tag_id) { return places.at(tag_id); });
  for (std::size_t i = 0; i < one.tags.size(); ++i) {
    const Pose X = level * other.tags[i].X_WT;
    EXPECT_LT((X.p - one.tags[i].X_WT.p).norm(), kSame);
    EXPECT_LT(angle_between(X.q, one.tags[i].X_WT.q), kSame);
    EXPECT_LT((other.tags[i].covariance - one.tags[i].covariance).norm(),
              1e-3 * one.tags[i].covariance.norm());
  }
}

TEST(MapGraphSimulation, SurveyedTagDefinesTheWorkspace) {
  const Robot robot({.seed = 3});
  const GraphSolution free = solution_of({robot});
  const Pose at{exp_so3({0, 0, 0.02}), {0.01, -0.02, 0.03}};
  TagMap survey;
  const GraphTagEstimate& one = free.tags[1];
  survey.tags.push_back({.tag = {one.tag_id, one.edge_m, at * one.X_WT, Matrix6d::Zero()},
                         .state = TagState::kSurveyed});
  const GraphSolution solution = value_of(graph_of({robot}, MapGraph(survey)).solve());
  ASSERT_EQ(solution.tags.size(), 3U);
  EXPECT_LT((solution.tags[1].X_WT.p - (at * one.X_WT).p).norm(), 1e-5);
  EXPECT_LT(std::sqrt(solution.tags[1].covariance.trace()), 1e-5) << "as surveyed";
  for (const std::size_t i : {0U, 2U}) {
    // The tilt is that of the survey; it moves the others far less than the room was moved.
    EXPECT_LT((solution.tags[i].X_WT.p - (at * free.tags[i].X_WT).p).norm(), 0.005);
    EXPECT_GT(std::sqrt(solution.tags[i].covariance.trace()), 1e-4);
  }
}

TEST(MapGraphSimulation, ReferenceTagDefinesTheWorkspace) {
  constexpr int kSeeds = 12;
  TagMap start;
  start.reference_tag = 1;
  double nees = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const Robot robot({.seed = seed, .reference_tag = 1});
    const GraphSolution solution = value_of(graph_of({robot}, MapGraph(start)).solve());
    // At the origin; its x axis is W's but for the tilt.
    const Eigen::Vector3d h = robot.truth.at(1).q * Eigen::Vector3d::UnitX();
    const Eigen::Quaterniond turn = exp_so3({0, 0, -std::atan2(h.y(), h.x())});
    const Pose X_WR{turn, -(turn * robot.truth.at(1).p)};
    for (const GraphTagEstimate& tag : solution.tags) {
      const Vector6d error = pose_error(tag.X_WT, X_WR * robot.truth.at(tag.tag_id));
      if (tag.tag_id != 1) {
        nees += normalised(error, tag.covariance) / 6 / (2 * kSeeds);
      } else {
        EXPECT_LT(error.head<3>().norm(), 1e-5) << error.transpose();
      }
    }
  }
  EXPECT_GT(nees, 0.5);
  EXPECT_LT(nees, 1.6);
}

TEST(MapGraphSimulation, StoredMapKeepsItsReferenceTag) {
  TagMap start;
  start.reference_tag = 1;
  const Robot robot({.seed = 3, .reference_tag = 1});
  const GraphSolution before = value_of(graph_of({robot}, MapGraph(start)).solve());
  start = stored(before);
  start.reference_tag = 1;
  MapGraph second(start);
  ASSERT_TRUE(second.add(robot.segments.back()));
  const auto after = value_of(second.solve());
  for (std::size_t i = 0; i < before.tags.size(); ++i) {
    const double was = before.tags[i].covariance.diagonal().head<3>().sum();
    const double is = after.tags[i].covariance.diagonal().head<3>().sum();
    if (before.tags[i].tag_id == 1) {
      EXPECT_LT((after.tags[i].X_WT.p - before.tags[i].X_WT.p).norm(), 1e-5);
      continue;
    }
    // One more second has little information about the heading of the reference tag.
    EXPECT_LT(is, 1.01 * was);
    EXPECT_GT(is, 0.3 * was);
  }
}

TEST(MapGraphSimulation, SegmentsHaveTheReprocessedStart) {
  const Robot robot({.seed = 5});
  EXPECT_LT(robot.segments.at(0).begin().at - kStart, std::chrono::milliseconds(500));
  for (std::size_t i = 1; i < robot.segments.size(); ++i)
    EXPECT_EQ(robot.segments[i].begin().at, robot.segments[i - 1].end().at) << i;
}

TEST(MapGraphSimulation, MissingSegmentEndsTheChain) {
  const Robot robot({.seed = 4});
  MapGraph graph;
  for (std::size_t i = 0; i < robot.segments.size(); ++i) {
    if (i == 2) continue;
    EXPECT_TRUE(graph.add(robot.segments[i]));
  }
  EXPECT_EQ(graph.state().starts.size(), 2U) << "the path between them is unknown";
  EXPECT_TRUE(graph.solve());
}

}  // namespace
}  // namespace fiducap
