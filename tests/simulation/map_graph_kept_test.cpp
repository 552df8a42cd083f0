// Information that a map graph keeps when segments are folded or stored, or a solution is stopped.
#include <gtest/gtest.h>

#include <future>
#include <thread>

#include "base/process.hpp"
#include "simulation/graph_robot.hpp"

namespace fiducap {
namespace {

/// Of each tag between two solutions: error in sigmas of the first, and ratio of sigmas.
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
    const Matrix6d& P = one.tags[i].covariance;
    const Vector6d e = pose_error(level * other.tags[i].X_WT, one.tags[i].X_WT);
    out.sigmas = std::max(out.sigmas, std::sqrt(normalised(e, P) / 6));
    for (int k = 0; k < 6; ++k) {
      const double ratio = std::sqrt(other.tags[i].covariance(k, k) / P(k, k));
      out.ratio_least = std::min(out.ratio_least, ratio);
      out.ratio_most = std::max(out.ratio_most, ratio);
    }
  }
  return out;
}

TEST(MapGraphSimulation, FoldingKeepsEstimatesAndSigmas) {
  constexpr std::size_t kKept = 12;  // folded segments are not linearised again
  const Robots robots = two_robots();
  const GraphSolution expected = solution_of(robots);
  MapGraph folded;
  GraphSolution found;
  for (const Robot& robot : robots) {
    for (const MotionSegment& segment : robot.segments) {
      EXPECT_TRUE(folded.add(segment));
      found = value_of(folded.solve());
      if (folded.state().segments.size() >= kKept) folded.fold();
    }
  }
  EXPECT_LT(folded.state().segments.size(), kKept);
  ASSERT_EQ(found.tags.size(), expected.tags.size());
  for (std::size_t i = 0; i < found.tags.size(); ++i)
    EXPECT_EQ(found.tags[i].sightings, expected.tags[i].sightings);
  // Each fold drops biases and the information of the path between two segments.
  const Difference apart = difference(expected, found);
  EXPECT_LT(apart.sigmas, 0.5);
  EXPECT_GT(apart.ratio_least, 0.95) << "nothing is counted twice";
  EXPECT_LT(apart.ratio_most, 1.4);
}

/// Solves every few segments, as a server does. @return the largest number of segments in the graph
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

// Three tags: 168 segments for any duration.
constexpr std::size_t kMostOfATable = 168;

TEST(MapGraphSimulation, GraphOfAMapStaysBounded) {
  const Robots robots = two_robots({.seconds = 200});
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
  EXPECT_GT(counted, sightings * 9 / 10) << "folded ones are still counted";
  const Score found = score(last->tags, robots.front().truth);
  // 3 tags, 12 degrees of freedom that count: the 99.9 % quantile of one draw is 2.7.
  EXPECT_LT(found.nees, 2.7);
  EXPECT_LT(found.worst_m, 0.001);
}

TEST(MapGraphSimulation, GraphWithoutWorkspaceStaysBounded) {
  const Robot robot({.id = 1, .seed = 3, .seconds = 250, .may_define_workspace = false});
  MapGraph graph;
  std::size_t most = 0;
  for (std::size_t i = 0; i < robot.segments.size(); ++i) {
    (void)graph.add(robot.segments[i]);
    if (i % 10 == 0) (void)graph.solve();
    most = std::max(most, graph.state().segments.size());
  }
  EXPECT_GT(graph.state().tags.size(), 2U);
  EXPECT_LE(most, kMostOfATable + 10);
}

TEST(MapGraphSimulation, StoredMapIsRefined) {
  const Robots robots = two_robots();
  const GraphSolution expected = solution_of(robots);
  const GraphSolution before = solution_of({robots[0]});
  MapGraph second(stored(before));
  for (MotionSegment segment : robots[1].segments) {
    // Its filter is in the axes of the stored map.
    const auto by_filter = [&](int tag_id) {
      const auto& tags = robots[1].segments.back().tags;
      return std::find_if(tags.begin(), tags.end(),
                          [&](const KnownTag& tag) { return tag.tag_id == tag_id; })
          ->X_WT;
    };
    const Pose G = level_between(before.tags, by_filter).inverse();
    move_axes(G, segment);
    EXPECT_TRUE(second.add(segment));
  }
  const auto after = value_of(second.solve());
  ASSERT_EQ(after.tags.size(), 3U);
  const Difference apart = difference(expected, after);
  EXPECT_LT(apart.sigmas, 0.3);
  EXPECT_GT(apart.ratio_least, 0.95);
  EXPECT_LT(apart.ratio_most, 1.1);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT(after.tags[i].covariance.trace(), before.tags[i].covariance.trace());
  // W is where the stored tags are in the mean.
  const Pose rest = level_between(
      after.tags, [&](int tag_id) { return before.tags[static_cast<std::size_t>(tag_id)].X_WT; });
  EXPECT_LT(rest.p.norm(), 1e-9);
  EXPECT_LT(angle_between(rest.q, Eigen::Quaterniond::Identity()), 1e-9);
}

TEST(MapGraphSimulation, TagsWithoutStoredCorrelationsGivePosesOnly) {
  const Robot robot({.seed = 3});
  const GraphSolution before = solution_of({robot});
  TagMap map = stored(before);
  map.known.reset();
  EXPECT_TRUE(MapGraph(map).state().tags.empty());
  const GraphSolution after = value_of(graph_of({robot}, MapGraph(map)).solve());
  EXPECT_GT(difference(before, after).ratio_least, 0.99) << "its covariances are not used";
}

TEST(MapGraphSimulation, StoppedSolutionIsNone) {
  MapGraph graph = graph_of({Robot({.seed = 4})});
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(graph.solve(stop.get_token()));
  EXPECT_TRUE(graph.solve()) << "the next call continues";
}

// In CPU time, which does not depend on other programs: time after the stop, of a whole solution.
TEST(MapGraphSimulation, SolutionStopsWithinAFractionOfItsTime) {
  constexpr double kBegun = 0.1;
  constexpr double kMostAfter = 0.1;
  // A wrong lens: every segment is linearised again, which is most of the work.
  const Robots robots = two_robots({.seconds = 60, .configured_focal = 1.01});
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
