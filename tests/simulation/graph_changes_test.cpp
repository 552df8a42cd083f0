// The map graph when tags are moved, and its findings about prints, lenses and clocks.
#include <gtest/gtest.h>

#include "simulation/graph_robot.hpp"

namespace fiducap {
namespace {

constexpr int kMovedTag = 1;
constexpr double kSeconds = 24;
constexpr double kMovedAt_s = 14;
const Eigen::Vector3d kMovedBy(0.05, -0.12, 0.03);

EpochOrder moved_at(double gone_s, double back_s) {
  return {kMovedTag, TagEpoch{kStart + from_seconds(gone_s), kStart + from_seconds(back_s)}};
}

TEST(MapGraphMoves, MovedTagHasTwoPoses) {
  constexpr double kNoticed_s = 2;
  simulation::FaultConfig faults;
  faults.moved_tag = kMovedTag;
  faults.moved_at_s = kMovedAt_s;
  faults.moved_by_m = kMovedBy;
  Robot robot({.seed = 3, .seconds = kSeconds, .faults = faults});
  MapGraph graph;
  const EpochOrder order = moved_at(kMovedAt_s, kMovedAt_s + kNoticed_s);
  bool is_ordered = false;
  for (const MotionSegment& segment : robot.segments) {
    if (!is_ordered && segment.begin().at > order.opens->back) {
      graph.follow(order);
      is_ordered = true;
    }
    EXPECT_TRUE(graph.add(segment));
  }
  const auto solution = value_of(graph.solve());
  ASSERT_EQ(solution.tags.size(), 4U);
  EXPECT_EQ(solution.pairs.size(), 3U) << "of current poses";
  std::vector<GraphTagEstimate> now;
  for (const GraphTagEstimate& tag : solution.tags)
    if (tag.is_current) now.push_back(tag);
  ASSERT_EQ(now.size(), 3U);
  EXPECT_EQ(now[1].epoch, 1);
  std::vector<GraphTagEstimate> before{solution.tags[0], solution.tags[1], solution.tags[3]};
  EXPECT_LT(score(before, robot.truth).worst_m, 0.003);
  EXPECT_LT(score(before, robot.truth).nees, 3);
  robot.truth.at(kMovedTag).p += kMovedBy;
  EXPECT_LT(score(now, robot.truth).worst_m, 0.003);
  EXPECT_LT(score(now, robot.truth).nees, 3);
  EXPECT_NEAR(solution.cost / solution.numbers, 0.95, 0.1) << "nothing contradicts";
}

TEST(MapGraphMoves, UnmovedTagIsUnitedAgain) {
  const Robot robot({.seed = 3, .seconds = kSeconds});
  MapGraph graph = graph_of({robot});
  graph.follow(moved_at(kMovedAt_s - 2, kMovedAt_s - 1));
  ASSERT_EQ(graph.state().tags.size(), 4U);
  graph.follow({kMovedTag, std::nullopt});
  const auto solution = value_of(graph.solve());
  ASSERT_EQ(solution.tags.size(), 3U);
  EXPECT_TRUE(solution.tags[1].is_current);
  EXPECT_LT(score(solution.tags, robot.truth).worst_m, 0.003);
}

TEST(MapGraphMoves, UnstableTagIsNotUsed) {
  MapGraph graph = graph_of({Robot({.seed = 3, .seconds = kSeconds})});
  const Instant gone = kStart + from_seconds(kMovedAt_s);
  graph.follow({kMovedTag, TagEpoch{gone, Instant::max()}});
  const auto solution = value_of(graph.solve());
  ASSERT_EQ(solution.tags.size(), 3U);
  EXPECT_FALSE(solution.tags[1].is_current);
  EXPECT_LE(solution.tags[1].last_seen, gone);
}

TEST(MapGraphMoves, PathBoundByTheMovedTagOnlyIsDropped) {
  // Two robots that share no other tag.
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
  EXPECT_TRUE(graph.add(whole)) << "a new chain";
  const auto solution = value_of(graph.solve());
  const auto here = in_component(solution, 0);
  EXPECT_EQ(here.size(), 2U);
  EXPECT_LT(score(here, one.truth).worst_m, 0.003);
  EXPECT_LT(here.front().covariance.norm(), 1e-3);
}

using Kind = FoundMismatch::Kind;

/// @return nullptr: there is none
const FoundMismatch* find(const GraphSolution& solution, Kind kind) {
  for (const GraphFinding& found : solution.findings)
    if (found.what.kind == kind) return &found.what;
  return nullptr;
}

TEST(GraphDoubts, FindsNothingWhenAllIsAsConfigured) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const GraphSolution solution = solution_of({Robot({.seed = seed})});
    EXPECT_TRUE(solution.findings.empty()) << "seed " << seed;
  }
}

TEST(GraphDoubts, NamesALargerPrintAndKeepsItsPose) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE(seed);
    const Robot robot({.seed = seed, .larger = {{1, 0.05}}});
    const GraphSolution solution = solution_of({robot});
    const FoundMismatch* found = find(solution, Kind::kOnePrint);
    ASSERT_NE(found, nullptr);
    EXPECT_EQ(found->tag_id, 1);
    EXPECT_NEAR(found->value, 0.05, 4 * found->sigma);
    EXPECT_EQ(solution.findings.size(), 1U) << "and no other finding";
    const Score all = score(solution.tags, robot.truth);
    EXPECT_LT(all.worst_m, 0.004);
    EXPECT_LT(all.nees, 3);
  }
}

TEST(GraphDoubts, NamesLargerPrintsAndKeepsTheScaleOfTheMap) {
  double nees = 0;
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    SCOPED_TRACE(seed);
    const Robot robot({.seed = seed, .seconds = 20, .larger = {{0, 0.02}, {1, 0.02}, {2, 0.02}}});
    const GraphSolution solution = solution_of({robot});
    const FoundMismatch* found = find(solution, Kind::kAllPrints);
    ASSERT_NE(found, nullptr);
    EXPECT_NEAR(found->value, 0.02, 4 * found->sigma);
    EXPECT_LT(found->sigma, 0.003);
    const Score all = score(solution.tags, robot.truth);
    EXPECT_LT(all.worst_m, 0.006);
    nees += all.nees / 4;
  }
  EXPECT_LT(nees, 2);
}

TEST(GraphDoubts, NamesAShorterLensWithItsBody) {
  const Robot robot({.id = 7, .seed = 3, .seconds = 20, .configured_focal = 1.01});
  const GraphSolution solution = solution_of({robot});
  const FoundMismatch* found = find(solution, Kind::kFocalLength);
  ASSERT_NE(found, nullptr);
  EXPECT_NEAR(found->value, 1 / 1.01 - 1, 4 * found->sigma);
  EXPECT_EQ(found->camera, 0);
  EXPECT_EQ(solution.findings.front().body_id, 7);
  EXPECT_LT(score(solution.tags, robot.truth).worst_m, 0.004);
}

TEST(GraphDoubts, TreatsAJumpedClockAsAnotherOne) {
  constexpr double kJump_s = 0.2;
  Robot robot({.seed = 5});
  const GraphSolution expected = solution_of({robot});
  // As its filter would do it: the body is in the same place, images have other stamps.
  for (std::size_t i = robot.segments.size() / 2; i < robot.segments.size(); ++i) {
    MotionSegment& segment = robot.segments[i];
    segment.chain += 1;
    segment.cameras[0].shift_s += kJump_s;
    for (auto& instance : segment.instances)
      for (SegmentImage& image : instance.images) image.applied_s += kJump_s;
  }
  MapGraph after = graph_of({robot});
  const GraphSolution found = value_of(after.solve());
  ASSERT_EQ(after.state().bodies.size(), 2U);
  const CameraBelief& old_one = after.state().bodies[0].cameras[0];
  const CameraBelief& new_one = after.state().bodies[1].cameras[0];
  EXPECT_NEAR(new_one.shift_s - old_one.shift_s, kJump_s, 0.003);
  EXPECT_LT((new_one.X_BV.p - old_one.X_BV.p).norm(), 1e-4);
  EXPECT_TRUE(found.findings.empty());
  for (std::size_t i = 0; i < found.tags.size(); ++i) {
    const double sigma_m = std::sqrt(expected.tags[i].covariance.topLeftCorner<3, 3>().trace());
    EXPECT_LT((found.tags[i].X_WT.p - expected.tags[i].X_WT.p).norm(), sigma_m);
  }
}

}  // namespace
}  // namespace fiducap
