// The map graph over what simulated bodies saw and felt, by way of their own pipelines.
#include <gtest/gtest.h>

#include "simulation/graph_robot.hpp"

namespace fiducap {
namespace {

TEST(MapGraphSimulation, OneBodyBringsTagsToTheTruthAndKnowsHowWell) {
  constexpr int kSeeds = 12;
  constexpr double kFewSigmas_m = 0.003;  // of half a millimetre
  double nees = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const Robots robots{Robot({.seed = seed})};
    MapGraph graph = graph_of(robots);
    const auto solution = graph.solve();
    ASSERT_TRUE(solution);
    ASSERT_EQ(solution->tags.size(), 3u);
    const Score one = score(solution->tags, robots[0].truth);
    EXPECT_LT(one.worst_m, kFewSigmas_m);
    EXPECT_LT(one.nees, 3);
    EXPECT_NEAR(solution->cost / solution->numbers, 0.95, 0.1) << "corners are as noisy as told";
    nees += one.nees / kSeeds;
  }
  EXPECT_GT(nees, 0.5);
  EXPECT_LT(nees, 1.6);
}

TEST(MapGraphSimulation, BodiesWithoutAnImuDoSo) {
  const Robots robots{Robot({.seed = 1, .has_imu = false})};
  MapGraph graph = graph_of(robots);
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  ASSERT_EQ(solution->tags.size(), 3u);
  // Not level: what they are against the first one has to do.
  const Pose& first = solution->tags[0].X_WT;
  for (const GraphTagEstimate& tag : solution->tags) {
    const Pose found = first.inverse() * tag.X_WT;
    const Pose expected = robots[0].truth.at(0).inverse() * robots[0].truth.at(tag.tag_id);
    EXPECT_LT((found.p - expected.p).norm(), 0.003);
    EXPECT_LT(angle_between(found.q, expected.q), 0.015);
  }
}

TEST(MapGraphSimulation, CountsSightingsAndTellsPairs) {
  const Robots robots{Robot({.seed = 2})};
  MapGraph graph = graph_of(robots);
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  std::map<int, int> sightings;
  for (const MotionSegment& segment : robots[0].segments)
    for (const auto& instance : segment.instances)
      for (const SegmentImage& image : instance.images)
        for (const SegmentSighting& s : image.tags) ++sightings[s.seen.tag_id];
  for (const GraphTagEstimate& tag : solution->tags)
    EXPECT_EQ(tag.sightings, sightings[tag.tag_id]) << tag.tag_id;
  EXPECT_EQ(solution->pairs.size(), 3u) << "each two of three";
}

TEST(MapGraphSimulation, ABodyInAxesOfItsOwnJoinsByTheTagsThatBothSee) {
  const Robots robots{Robot({.id = 1, .seed = 3}),
                      Robot({.id = 2, .seed = 4, .may_define_workspace = false})};
  ASSERT_TRUE(robots[0].segments.front().anchored);
  ASSERT_FALSE(robots[1].segments.front().anchored);
  MapGraph graph = graph_of(robots);
  for (const GraphNode& node : graph.state().nodes) EXPECT_EQ(node.component, 0);
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  ASSERT_EQ(in_component(*solution, 0).size(), 3u);
  EXPECT_EQ(solution->tags.size(), 3u) << "none is there twice";
  const Score together = score(solution->tags, robots[0].truth);
  EXPECT_LT(together.worst_m, 0.003);
  EXPECT_LT(together.nees, 3);
}

TEST(MapGraphSimulation, ABodyThatFindsTheWorkspaceOnItsWayTakesWhatItKnowsAlong) {
  Robot robot({.seed = 4, .may_define_workspace = false});
  // From its third segment on its filter stands in the workspace.
  const Pose G{exp_so3({0, 0, 0.7}), {1, 2, 3}};
  for (std::size_t i = 2; i < robot.segments.size(); ++i) {
    MotionSegment& segment = robot.segments[i];
    segment.anchored = true;
    for (auto& instance : segment.instances) instance.body = in_other_axes(G, instance.body);
    for (KnownTag& tag : segment.tags) tag.X_WT = G * tag.X_WT;
  }
  const Pose expected = robot.segments.back().tags.front().X_WT;
  MapGraph graph = graph_of({robot});
  for (const GraphNode& node : graph.state().nodes) EXPECT_EQ(node.component, 0);
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  ASSERT_EQ(solution->tags.size(), 3u);
  EXPECT_LT(score(solution->tags, robot.truth).worst_m, 0.003);
  EXPECT_LT((solution->tags.front().X_WT.p - expected.p).norm(), 0.02) << "in those axes";
}

TEST(MapGraphSimulation, TwoBodiesWithoutAWorkspaceAreOneComponent) {
  const Robots robots{Robot({.id = 1, .seed = 3, .may_define_workspace = false}),
                      Robot({.id = 2, .seed = 4, .may_define_workspace = false})};
  MapGraph graph = graph_of(robots);
  const int component = graph.state().nodes.front().component;
  EXPECT_NE(component, 0);
  for (const GraphNode& node : graph.state().nodes) EXPECT_EQ(node.component, component);
  ASSERT_EQ(graph.state().tags.size(), 3u);
  // Before anything is solved, the second one stands where its tags say.
  std::map<int, Pose> places;
  for (const GraphTag& tag : graph.state().tags) places[tag.tag_id] = tag.X_WT;
  for (const auto& [tag_id, X] : places) {
    const double found = (X.p - places.begin()->second.p).norm();
    const double expected = (robots[0].truth.at(tag_id).p - robots[0].truth.at(0).p).norm();
    EXPECT_NEAR(found, expected, 0.02);
  }
  EXPECT_FALSE(graph.solve()) << "no tag says where W is";
}

TEST(MapGraphSimulation, ATagWhoseTiltContradictsDoesNotJoinAndDoesNoHarm) {
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
  const Robots robots{Robot({.id = 1, .seed = 3}),
                      Robot({.id = 2, .seed = 4, .room = other, .may_define_workspace = false})};
  MapGraph graph = graph_of(robots);
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  const auto here = in_component(*solution, 0);
  EXPECT_EQ(here.size(), 3u);
  EXPECT_EQ(solution->tags.size(), 6u) << "each has the tag in its own place";
  EXPECT_LT(score(here, robots[0].truth).worst_m, 0.003);
  EXPECT_LT(solution->cost / solution->numbers, 1.1) << "nothing contradicts within a component";
}

TEST(MapGraphSimulation, TheOrderOfTheBodiesDoesNotMatter) {
  constexpr double kSame = 1e-6;  // m and rad
  Robots robots{Robot({.id = 1, .seed = 3}),
                Robot({.id = 2, .seed = 4, .may_define_workspace = false})};
  MapGraph one_way = graph_of(robots);
  std::swap(robots[0], robots[1]);
  MapGraph other_way = graph_of(robots);
  const auto one = one_way.solve();
  const auto other = other_way.solve();
  ASSERT_TRUE(one && other);
  ASSERT_EQ(one->tags.size(), other->tags.size());
  std::map<int, Pose> places;
  for (const GraphTagEstimate& tag : one->tags) places[tag.tag_id] = tag.X_WT;
  const Pose level = level_between(other->tags, [&](int tag_id) { return places.at(tag_id); });
  for (std::size_t i = 0; i < one->tags.size(); ++i) {
    const Pose X = level * other->tags[i].X_WT;
    EXPECT_LT((X.p - one->tags[i].X_WT.p).norm(), kSame);
    EXPECT_LT(angle_between(X.q, one->tags[i].X_WT.q), kSame);
    EXPECT_LT((other->tags[i].covariance - one->tags[i].covariance).norm(),
              1e-3 * one->tags[i].covariance.norm());
  }
}

TEST(MapGraphSimulation, KeepsTheMeanOfTheTagsThatDefineTheAxes) {
  const Robot robot({.seed = 3});
  MapGraph graph;
  EXPECT_FALSE(graph.solve()) << "there is nothing yet";
  for (std::size_t i = 0; i < 2; ++i) EXPECT_TRUE(graph.add(robot.segments[i]));
  const auto before = graph.solve();
  ASSERT_TRUE(before);
  graph.define_axes();
  for (std::size_t i = 2; i < robot.segments.size(); ++i) EXPECT_TRUE(graph.add(robot.segments[i]));
  const auto after = graph.solve();
  ASSERT_TRUE(after);
  ASSERT_EQ(after->tags.size(), before->tags.size());
  std::map<int, Pose> places;
  double moved_m = 0;
  for (const GraphTagEstimate& tag : before->tags) places[tag.tag_id] = tag.X_WT;
  for (const GraphTagEstimate& tag : after->tags)
    moved_m += (tag.X_WT.p - places.at(tag.tag_id).p).norm();
  EXPECT_GT(moved_m, 1e-5) << "something was learned";
  const Pose rest = level_between(after->tags, [&](int tag_id) { return places.at(tag_id); });
  EXPECT_LT(rest.p.norm(), 1e-9);
  EXPECT_LT(angle_between(rest.q, Eigen::Quaterniond::Identity()), 1e-9);
}

TEST(MapGraphSimulation, AMissingSegmentEndsTheChain) {
  const Robot robot({.seed = 4});
  MapGraph graph;
  for (std::size_t i = 0; i < robot.segments.size(); ++i) {
    if (i != 2) EXPECT_TRUE(graph.add(robot.segments[i]));
  }
  EXPECT_EQ(graph.state().starts.size(), 2U) << "nothing says how it got over there";
  EXPECT_TRUE(graph.solve());
}

TEST(MapGraphSimulation, AStoppedSolutionIsNone) {
  MapGraph graph;
  const Robot robot({.seed = 4});
  for (const MotionSegment& segment : robot.segments) EXPECT_TRUE(graph.add(segment));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(graph.solve(stop.get_token()));
  EXPECT_TRUE(graph.solve()) << "the next call goes on";
}

}  // namespace
}  // namespace fiducap
