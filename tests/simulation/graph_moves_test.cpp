// The map graph when a tag does not stay where it was.
#include <gtest/gtest.h>

#include "simulation/graph_robot.hpp"

namespace fiducap {
namespace {

constexpr int kMovedTag = 1;
constexpr double kSeconds = 24;
constexpr double kMovedAt_s = 14;
const Eigen::Vector3d kMovedBy(0.05, -0.12, 0.03);

Robot robot_whose_tag_is_moved() {
  simulation::FaultConfig faults;
  faults.moved_tag = kMovedTag;
  faults.moved_at_s = kMovedAt_s;
  faults.moved_by_m = kMovedBy;
  return Robot({.seed = 3, .seconds = kSeconds, .faults = faults});
}

EpochOrder moved_at(double gone_s, double back_s) {
  return {kMovedTag, TagEpoch{kStart + from_seconds(gone_s), kStart + from_seconds(back_s)}};
}

TEST(MapGraphMoves, ATagThatWasMovedHasTwoPlacesAndHarmsNoOther) {
  constexpr double kNoticed_s = 2;
  Robot robot = robot_whose_tag_is_moved();
  MapGraph graph;
  const EpochOrder order = moved_at(kMovedAt_s, kMovedAt_s + kNoticed_s);
  bool is_told = false;
  for (const MotionSegment& segment : robot.segments) {
    if (!is_told && segment.begin().at > order.opens->back) {
      graph.follow(order);
      is_told = true;
    }
    EXPECT_TRUE(graph.add(segment));
  }
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  ASSERT_EQ(solution->tags.size(), 4U);
  EXPECT_EQ(solution->pairs.size(), 3U) << "of the places of now";
  std::vector<GraphTagEstimate> now;
  for (const GraphTagEstimate& tag : solution->tags)
    if (tag.is_current) now.push_back(tag);
  ASSERT_EQ(now.size(), 3U);
  EXPECT_EQ(now[1].epoch, 1);
  std::vector<GraphTagEstimate> before{solution->tags[0], solution->tags[1], solution->tags[3]};
  EXPECT_LT(score(before, robot.truth).worst_m, 0.003);
  EXPECT_LT(score(before, robot.truth).nees, 3);
  robot.truth.at(kMovedTag).p += kMovedBy;
  EXPECT_LT(score(now, robot.truth).worst_m, 0.003);
  EXPECT_LT(score(now, robot.truth).nees, 3);
  EXPECT_NEAR(solution->cost / solution->numbers, 0.95, 0.1) << "nothing contradicts";
}

TEST(MapGraphMoves, ATagThatHadNotMovedIsOneAgain) {
  const Robot robot({.seed = 3, .seconds = kSeconds});
  MapGraph graph;
  for (const MotionSegment& segment : robot.segments) EXPECT_TRUE(graph.add(segment));
  graph.follow(moved_at(kMovedAt_s - 2, kMovedAt_s - 1));
  ASSERT_EQ(graph.state().tags.size(), 4U);
  graph.follow({kMovedTag, std::nullopt});
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  ASSERT_EQ(solution->tags.size(), 3U);
  EXPECT_TRUE(solution->tags[1].is_current);
  EXPECT_LT(score(solution->tags, robot.truth).worst_m, 0.003);
}

TEST(MapGraphMoves, ATagThatIsGivenUpIsNotUsedAnyMore) {
  const Robot robot({.seed = 3, .seconds = kSeconds});
  MapGraph graph;
  const Instant gone = kStart + from_seconds(kMovedAt_s);
  for (const MotionSegment& segment : robot.segments) EXPECT_TRUE(graph.add(segment));
  graph.follow({kMovedTag, TagEpoch{gone, Instant::max()}});
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  ASSERT_EQ(solution->tags.size(), 3U);
  EXPECT_FALSE(solution->tags[1].is_current);
  EXPECT_LE(solution->tags[1].last_seen, gone);
}

TEST(MapGraphMoves, APathThatOnlyTheMovedTagBoundIsForgotten) {
  // Of two robots that share no other tag.
  const Robot one({.id = 1, .seed = 3});
  Robot other({.id = 2, .seed = 4});
  const MotionSegment whole = other.segments.back();
  for (MotionSegment& segment : other.segments) {
    std::erase_if(segment.tags, [](const KnownTag& tag) { return tag.tag_id != kMovedTag; });
    for (auto& instance : segment.instances)
      for (SegmentImage& image : instance.images)
        std::erase_if(image.tags, [](const auto& s) { return s.seen.tag_id != kMovedTag; });
  }
  MapGraph graph = graph_of({one, other});
  ASSERT_EQ(graph.state().nodes.size(), one.segments.size() + other.segments.size() + 2);
  graph.follow({kMovedTag, TagEpoch{kStart, kStart}});
  EXPECT_EQ(graph.state().nodes.back().component, 0) << "bound by its new place";
  graph.follow({kMovedTag, TagEpoch{kStart, Instant::max()}});
  EXPECT_EQ(graph.state().nodes.size(), one.segments.size() + 1) << "bound by nothing";
  EXPECT_FALSE(graph.add(other.segments.back()));
  EXPECT_TRUE(graph.add(whole)) << "a chain begins anew";
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  const auto here = in_component(*solution, 0);
  EXPECT_EQ(here.size(), 2U);
  EXPECT_LT(score(here, one.truth).worst_m, 0.003);
  EXPECT_LT(here.front().covariance.norm(), 1e-3);
}

}  // namespace
}  // namespace fiducap
