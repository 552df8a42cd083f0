// The map graph over what simulated bodies saw and felt, by way of their own pipelines.
#include <gtest/gtest.h>

#include <future>
#include <thread>

#include "base/this_thread.hpp"
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
  // Half way its filter comes to stand in the workspace.
  const Pose G{exp_so3({0, 0, 0.7}), {1, 2, 3}};
  for (std::size_t i = robot.segments.size() / 2; i < robot.segments.size(); ++i) {
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
  constexpr double kFirstSight_m = 0.05;  // nobody said where W is: tags stay where they came to be
  EXPECT_LT((solution->tags.front().X_WT.p - expected.p).norm(), kFirstSight_m);
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

/// The map as a server would store it.
TagMap stored(const GraphSolution& solution) {
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

/// Of each tag against the first one, in sigmas of what is known best, and how its sigma differs.
struct Difference {
  double sigmas{};
  double ratio_least{1e9};
  double ratio_most{};
};

Difference difference(const GraphSolution& one, const GraphSolution& other) {
  Difference out;
  const Pose level = level_between(
      other.tags, [&](int tag_id) { return one.tags[static_cast<std::size_t>(tag_id)].X_WT; });
  for (std::size_t i = 0; i < one.tags.size(); ++i) {
    const Pose X = level * other.tags[i].X_WT;
    Vector6d e;
    e << X.p - one.tags[i].X_WT.p, log_so3(X.q * one.tags[i].X_WT.q.conjugate());
    const Matrix6d& P = one.tags[i].covariance;
    out.sigmas = std::max(out.sigmas, std::sqrt(e.dot(P.ldlt().solve(e)) / 6));
    for (int k = 0; k < 6; ++k) {
      const double ratio = std::sqrt(other.tags[i].covariance(k, k) / P(k, k));
      out.ratio_least = std::min(out.ratio_least, ratio);
      out.ratio_most = std::max(out.ratio_most, ratio);
    }
  }
  return out;
}

TEST(MapGraphSimulation, WhatIsFoldedIsKnownAsBefore) {
  constexpr std::size_t kKept = 12;  // what is folded is linearised for good
  const Robots robots{Robot({.id = 1, .seed = 3}), Robot({.id = 2, .seed = 4})};
  MapGraph whole = graph_of(robots);
  const auto expected = whole.solve();
  MapGraph folded;
  std::optional<GraphSolution> found;
  for (const Robot& robot : robots) {
    for (const MotionSegment& segment : robot.segments) {
      EXPECT_TRUE(folded.add(segment));
      found = folded.solve();
      ASSERT_TRUE(found);
      if (folded.state().segments.size() >= kKept) folded.fold();
    }
  }
  EXPECT_LT(folded.state().segments.size(), kKept);
  ASSERT_TRUE(expected);
  ASSERT_EQ(found->tags.size(), expected->tags.size());
  for (std::size_t i = 0; i < found->tags.size(); ++i)
    EXPECT_EQ(found->tags[i].sightings, expected->tags[i].sightings);
  // Biases are lost at each fold, and what the body's path between two segments said.
  const Difference apart = difference(*expected, *found);
  EXPECT_LT(apart.sigmas, 0.5);
  EXPECT_GT(apart.ratio_least, 0.95) << "nothing is counted twice";
  EXPECT_LT(apart.ratio_most, 1.4);
}

/// Solves every few segments, as a server does. @return the most that were in the graph after one
std::size_t most_kept(const Robots& robots, MapGraph& graph, std::optional<GraphSolution>& last) {
  constexpr std::size_t kBetweenSolutions = 10;
  std::size_t most = 0;
  for (const Robot& robot : robots) {
    for (std::size_t i = 0; i < robot.segments.size(); ++i) {
      (void)graph.add(robot.segments[i]);
      if (i % kBetweenSolutions != 0) continue;
      last = graph.solve();
      EXPECT_TRUE(last) << "segment " << i << " of robot " << robot.id;
      most = std::max(most, graph.state().segments.size());
    }
  }
  return most;
}

// Three tags: 168 segments, however long they are looked at.
constexpr std::size_t kMostOfATable = 168;

TEST(MapGraphSimulation, AMapHasASizeHoweverLongItIsLookedAt) {
  const Robots robots{Robot({.id = 1, .seed = 3, .seconds = 200}),
                      Robot({.id = 2, .seed = 4, .seconds = 200})};
  MapGraph graph;
  std::optional<GraphSolution> last;
  EXPECT_LE(most_kept(robots, graph, last), kMostOfATable);
  ASSERT_TRUE(last);
  int sightings = 0;
  for (const Robot& robot : robots)
    for (const MotionSegment& segment : robot.segments)
      for (const auto& instance : segment.instances)
        for (const SegmentImage& image : instance.images)
          sightings += static_cast<int>(image.tags.size());
  int counted = 0;
  for (const GraphTagEstimate& tag : last->tags) counted += tag.sightings;
  EXPECT_GT(counted, sightings * 9 / 10) << "all that was given up is still counted";
  const Score found = score(last->tags, robots.front().truth);
  // 3 tags, 12 degrees of freedom that count: the 99.9 % quantile of one draw is 2.7.
  EXPECT_LT(found.nees, 2.7);
  EXPECT_LT(found.worst_m, 0.001);
}

TEST(MapGraphSimulation, SoHasOneThatNobodyHasBroughtIntoTheWorkspace) {
  const Robots robots{Robot({.id = 1, .seed = 3, .seconds = 250, .may_define_workspace = false})};
  MapGraph graph;
  std::size_t most = 0;
  for (std::size_t i = 0; i < robots.front().segments.size(); ++i) {
    (void)graph.add(robots.front().segments[i]);
    if (i % 10 == 0) (void)graph.solve();
    most = std::max(most, graph.state().segments.size());
  }
  EXPECT_GT(graph.state().tags.size(), 2U);
  EXPECT_LE(most, kMostOfATable + 10);
}

TEST(MapGraphSimulation, AStoredMapGoesOnLearning) {
  const Robots robots{Robot({.id = 1, .seed = 3}), Robot({.id = 2, .seed = 4})};
  MapGraph whole = graph_of(robots);
  const auto expected = whole.solve();
  MapGraph first = graph_of({robots[0]});
  const auto before = first.solve();
  ASSERT_TRUE(expected && before);
  MapGraph second(stored(*before));
  for (MotionSegment segment : robots[1].segments) {
    // Its filter stands in the axes of the stored map.
    const auto as_it_has = [&](int tag_id) {
      const auto& tags = robots[1].segments.back().tags;
      return std::find_if(tags.begin(), tags.end(),
                          [&](const KnownTag& tag) { return tag.tag_id == tag_id; })
          ->X_WT;
    };
    const Pose G = level_between(before->tags, as_it_has).inverse();
    for (auto& instance : segment.instances) instance.body = in_other_axes(G, instance.body);
    for (KnownTag& tag : segment.tags) tag.X_WT = G * tag.X_WT;
    EXPECT_TRUE(second.add(segment));
  }
  const auto after = second.solve();
  ASSERT_TRUE(after);
  ASSERT_EQ(after->tags.size(), 3U);
  const Difference apart = difference(*expected, *after);
  EXPECT_LT(apart.sigmas, 0.3);
  EXPECT_GT(apart.ratio_least, 0.95);
  EXPECT_LT(apart.ratio_most, 1.1);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT(after->tags[i].covariance.trace(), before->tags[i].covariance.trace());
  // W is where the stored tags are in the mean.
  const Pose rest = level_between(
      after->tags, [&](int tag_id) { return before->tags[static_cast<std::size_t>(tag_id)].X_WT; });
  EXPECT_LT(rest.p.norm(), 1e-9);
  EXPECT_LT(angle_between(rest.q, Eigen::Quaterniond::Identity()), 1e-9);
}

TEST(MapGraphSimulation, ASurveyedTagSaysWhereTheRoomIs) {
  const Robot robot({.seed = 3});
  MapGraph graph = graph_of({robot});
  const auto free = graph.solve();
  ASSERT_TRUE(free);
  const Pose at{exp_so3({0, 0, 0.02}), {0.01, -0.02, 0.03}};
  TagMap survey;
  const GraphTagEstimate& one = free->tags[1];
  survey.tags.push_back({.tag = {one.tag_id, one.edge_m, at * one.X_WT, Matrix6d::Zero()},
                         .state = TagState::kSurveyed});
  MapGraph surveyed(survey);
  for (const MotionSegment& segment : robot.segments) EXPECT_TRUE(surveyed.add(segment));
  const auto solution = surveyed.solve();
  ASSERT_TRUE(solution);
  ASSERT_EQ(solution->tags.size(), 3U);
  EXPECT_LT((solution->tags[1].X_WT.p - (at * one.X_WT).p).norm(), 1e-5);
  EXPECT_LT(std::sqrt(solution->tags[1].covariance.trace()), 1e-5) << "as the survey says";
  for (const std::size_t i : {0U, 2U}) {
    // Its tilt is the survey's; what that moves is far less than the room was moved.
    EXPECT_LT((solution->tags[i].X_WT.p - (at * free->tags[i].X_WT).p).norm(), 0.005);
    EXPECT_GT(std::sqrt(solution->tags[i].covariance.trace()), 1e-4);
  }
}

TEST(MapGraphSimulation, AReferenceTagSaysWhereTheRoomIs) {
  constexpr int kSeeds = 12;
  TagMap start;
  start.reference_tag = 1;
  double nees = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const Robot robot({.seed = seed, .reference_tag = 1});
    MapGraph graph(start);
    for (const MotionSegment& segment : robot.segments) EXPECT_TRUE(graph.add(segment));
    const auto solution = graph.solve();
    ASSERT_TRUE(solution);
    // At the origin; its x axis is W's but for the tilt.
    const Eigen::Vector3d h = robot.truth.at(1).q * Eigen::Vector3d::UnitX();
    const Eigen::Quaterniond turn = exp_so3({0, 0, -std::atan2(h.y(), h.x())});
    const Pose X_WR{turn, -(turn * robot.truth.at(1).p)};
    for (const GraphTagEstimate& tag : solution->tags) {
      const Pose truth = X_WR * robot.truth.at(tag.tag_id);
      Vector6d error;
      error << tag.X_WT.p - truth.p, log_so3(tag.X_WT.q * truth.q.conjugate());
      const bool is_reference = tag.tag_id == 1;
      EXPECT_TRUE(!is_reference || error.head<3>().norm() < 1e-5) << error.transpose();
      if (is_reference) continue;
      nees += error.dot(tag.covariance.ldlt().solve(error)) / 6 / (2 * kSeeds);
    }
  }
  EXPECT_GT(nees, 0.5);
  EXPECT_LT(nees, 1.6);
}

TEST(MapGraphSimulation, AMapThatHangsOnItsReferenceTagGoesOnDoingSo) {
  TagMap start;
  start.reference_tag = 1;
  const Robot robot({.seed = 3, .reference_tag = 1});
  MapGraph first(start);
  for (const MotionSegment& segment : robot.segments) (void)first.add(segment);
  const auto before = first.solve();
  ASSERT_TRUE(before);
  auto known = std::make_shared<KnownMap>();
  known->pairs = before->pairs;
  for (const GraphTagEstimate& tag : before->tags) {
    known->tags.push_back({tag.tag_id, tag.edge_m, tag.X_WT, tag.covariance});
    start.tags.push_back({known->tags.back(), TagState::kCalibrated, 0, 0, tag.sightings, 0});
  }
  start.known = std::move(known);
  MapGraph second(start);
  MotionSegment again = robot.segments.back();
  ASSERT_TRUE(second.add(again));
  const auto after = second.solve();
  ASSERT_TRUE(after);
  for (std::size_t i = 0; i < before->tags.size(); ++i) {
    const double was = before->tags[i].covariance.diagonal().head<3>().sum();
    const double is = after->tags[i].covariance.diagonal().head<3>().sum();
    if (before->tags[i].tag_id == 1) {
      EXPECT_LT((after->tags[i].X_WT.p - before->tags[i].X_WT.p).norm(), 1e-5);
      continue;
    }
    // A second more says little of the heading that the others' places hang on.
    EXPECT_LT(is, 1.01 * was);
    EXPECT_GT(is, 0.3 * was);
  }
}

TEST(MapGraphSimulation, AStartThatWasFollowedAgainIsInTheSegments) {
  const Robot robot({.seed = 5});
  EXPECT_LT(robot.segments.at(0).begin().at - kStart, std::chrono::milliseconds(500));
  for (std::size_t i = 1; i < robot.segments.size(); ++i)
    EXPECT_EQ(robot.segments[i].begin().at, robot.segments[i - 1].end().at) << i;
}

TEST(MapGraphSimulation, TagsWhoseTiesAreNotStoredGiveTheirPlacesOnly) {
  const Robot robot({.seed = 3});
  MapGraph first = graph_of({robot});
  const auto before = first.solve();
  ASSERT_TRUE(before);
  TagMap map = stored(*before);
  map.known.reset();
  MapGraph second(map);
  EXPECT_TRUE(second.state().tags.empty());
  for (const MotionSegment& segment : robot.segments) EXPECT_TRUE(second.add(segment));
  const auto after = second.solve();
  ASSERT_TRUE(after);
  const Difference apart = difference(*before, *after);
  EXPECT_GT(apart.ratio_least, 0.99) << "its covariances say nothing";
}

TEST(MapGraphSimulation, AMissingSegmentEndsTheChain) {
  const Robot robot({.seed = 4});
  MapGraph graph;
  for (std::size_t i = 0; i < robot.segments.size(); ++i) {
    if (i == 2) continue;
    EXPECT_TRUE(graph.add(robot.segments[i]));
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

// In CPU time, which other programs do not change: what was spent after the stop, of a whole one.
TEST(MapGraphSimulation, ASolutionUnderWayIsAbandonedWithinAFractionOfIt) {
  constexpr double kBegun = 0.1;
  constexpr double kMostAfter = 0.1;
  // A wrong lens: every segment is linearised again, which is most of the work.
  const Robots robots{Robot({.id = 1, .seed = 3, .seconds = 60, .told_focal = 1.01}),
                      Robot({.id = 2, .seed = 4, .seconds = 60, .told_focal = 1.01})};
  MapGraph whole = graph_of(robots);
  MapGraph abandoned = graph_of(robots);
  const Duration before = thread_cpu_time();
  EXPECT_TRUE(whole.solve());
  const Duration takes = thread_cpu_time() - before;
  std::promise<ThreadHandle> begun;
  Duration used{};
  std::stop_source stop;
  std::jthread solving([&] {
    begun.set_value(this_thread());
    EXPECT_FALSE(abandoned.solve(stop.get_token()));
    used = thread_cpu_time();
  });
  const ThreadHandle thread = begun.get_future().get();
  while (thread.cpu_time() < kBegun * takes) std::this_thread::yield();
  const Duration stopped = thread.cpu_time();
  stop.request_stop();
  solving.join();
  EXPECT_LT(to_seconds(used - stopped), kMostAfter * to_seconds(takes));
}

}  // namespace
}  // namespace fiducap
