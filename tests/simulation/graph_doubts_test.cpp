// What a map graph finds out about prints, lenses and clocks that are not as configured.
#include <gtest/gtest.h>

#include "simulation/graph_robot.hpp"

namespace fiducap {
namespace {

using Kind = FoundMismatch::Kind;

/// @return nullptr: it was not found
const FoundMismatch* find(const GraphSolution& solution, Kind kind) {
  for (const GraphFinding& found : solution.findings)
    if (found.what.kind == kind) return &found.what;
  return nullptr;
}

TEST(GraphDoubts, NothingIsAccusedWhereEverythingIsAsConfigured) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    MapGraph graph = graph_of({Robot({.seed = seed})});
    const auto solution = graph.solve();
    ASSERT_TRUE(solution);
    EXPECT_TRUE(solution->findings.empty()) << "seed " << seed;
  }
}

TEST(GraphDoubts, APrintThatIsLargerIsNamedAndStandsWhereItIs) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE(seed);
    const Robot robot({.seed = seed, .larger = {{1, 0.05}}});
    MapGraph graph = graph_of({robot});
    const auto solution = graph.solve();
    ASSERT_TRUE(solution);
    const FoundMismatch* found = find(*solution, Kind::kOnePrint);
    ASSERT_NE(found, nullptr);
    EXPECT_EQ(found->tag_id, 1);
    EXPECT_NEAR(found->value, 0.05, 4 * found->sigma);
    EXPECT_EQ(solution->findings.size(), 1U) << "and nobody else";
    const Score all = score(solution->tags, robot.truth);
    EXPECT_LT(all.worst_m, 0.004);
    EXPECT_LT(all.nees, 3);
  }
}

TEST(GraphDoubts, PrintsThatAreAllLargerAreNamedAndTheMapIsAsLargeAsTheRoom) {
  double nees = 0;
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    SCOPED_TRACE(seed);
    const Robot robot({.seed = seed, .seconds = 20, .larger = {{0, 0.02}, {1, 0.02}, {2, 0.02}}});
    MapGraph graph = graph_of({robot});
    const auto solution = graph.solve();
    ASSERT_TRUE(solution);
    const FoundMismatch* found = find(*solution, Kind::kAllPrints);
    ASSERT_NE(found, nullptr);
    EXPECT_NEAR(found->value, 0.02, 4 * found->sigma);
    EXPECT_LT(found->sigma, 0.003);
    const Score all = score(solution->tags, robot.truth);
    EXPECT_LT(all.worst_m, 0.006);
    nees += all.nees / 4;
  }
  EXPECT_LT(nees, 2);
}

TEST(GraphDoubts, ALensThatIsShorterIsNamedWithItsBody) {
  const Robot robot({.id = 7, .seed = 3, .seconds = 20, .told_focal = 1.01});
  MapGraph graph = graph_of({robot});
  const auto solution = graph.solve();
  ASSERT_TRUE(solution);
  const FoundMismatch* found = find(*solution, Kind::kFocalLength);
  ASSERT_NE(found, nullptr);
  EXPECT_NEAR(found->value, 1 / 1.01 - 1, 4 * found->sigma);
  EXPECT_EQ(found->camera, 0);
  EXPECT_EQ(solution->findings.front().body_id, 7);
  EXPECT_LT(score(solution->tags, robot.truth).worst_m, 0.004);
}

TEST(GraphDoubts, AfterAClockHasJumpedItIsAnotherOneAndAllElseTheSame) {
  constexpr double kJump_s = 0.2;
  Robot robot({.seed = 5});
  MapGraph before = graph_of({robot});
  const auto expected = before.solve();
  // As its filter would: the body is where it was, images carry other stamps.
  for (std::size_t i = robot.segments.size() / 2; i < robot.segments.size(); ++i) {
    MotionSegment& segment = robot.segments[i];
    segment.chain += 1;
    segment.cameras[0].shift_s += kJump_s;
    for (auto& instance : segment.instances)
      for (SegmentImage& image : instance.images) image.applied_s += kJump_s;
  }
  MapGraph after = graph_of({robot});
  const auto found = after.solve();
  ASSERT_TRUE(expected && found);
  ASSERT_EQ(after.state().bodies.size(), 2U);
  const CameraBelief& old_one = after.state().bodies[0].cameras[0];
  const CameraBelief& new_one = after.state().bodies[1].cameras[0];
  EXPECT_NEAR(new_one.shift_s - old_one.shift_s, kJump_s, 0.003);
  EXPECT_LT((new_one.X_BV.p - old_one.X_BV.p).norm(), 1e-4);
  EXPECT_TRUE(found->findings.empty());
  for (std::size_t i = 0; i < found->tags.size(); ++i) {
    const double sigma_m = std::sqrt(expected->tags[i].covariance.topLeftCorner<3, 3>().trace());
    EXPECT_LT((found->tags[i].X_WT.p - expected->tags[i].X_WT.p).norm(), sigma_m);
  }
}

}  // namespace
}  // namespace fiducap
