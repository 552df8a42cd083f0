// The map of a whole session, refined while it is made: pipelines, builder and refiner as in the
// server, in virtual time.
#include "mapping/map_refiner.hpp"

#include <gtest/gtest.h>

#include "base/pose.hpp"
#include "mapping/tag_map.hpp"
#include "simulation/filter_run.hpp"

namespace fiducap {
namespace {

constexpr double kSeconds = 40;

std::vector<EstimationData> two_robots_on_a_ring() {
  std::vector<EstimationData> robots;
  for (std::uint64_t k = 0; k < 2; ++k) {
    robots.push_back(simulate({.world = "ring",
                               .seconds = kSeconds,
                               .seed = 5 + 100 * k,
                               .from = 0.1 * static_cast<double>(k),
                               .share = 0.25}));
  }
  for (EstimationData& robot : robots) robot.reference_tag = robots.front().reference_tag;
  return robots;
}

TEST(MapRefinerSimulation, TwoRobotsMakeOneMapThatKnowsHowGoodItIs) {
  const auto robots = two_robots_on_a_ring();
  FilterChoice choice;
  choice.filter = "world";
  choice.live = true;
  choice.refine_period_s = 2;
  std::vector<int> shifted(robots.size());
  std::vector<int> placed(robots.size());
  choice.listen = [&](std::size_t body, const BodyUpdate& update, const TagMap&) {
    shifted[body] += update.report.map_shift ? 1 : 0;
    placed[body] += update.is_placed() ? 1 : 0;
  };
  const TogetherRun run = run_together(robots, choice);
  ASSERT_NE(run.map.known, nullptr);
  EXPECT_GT(run.map.tags.size(), 25U);
  EXPECT_FALSE(run.map.known->pairs.empty());
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
  for (const KnownTag& tag : run.map.known->tags)
    points.emplace_back(tag.X_WT.p, robots.front().tag(tag.tag_id)->X_WT.p);
  const Pose level = fit_yaw_and_shift(points);
  double square = 0;
  for (const KnownTag& tag : run.map.known->tags)
    square += (level * tag.X_WT.p - robots.front().tag(tag.tag_id)->X_WT.p).squaredNorm();
  EXPECT_LT(std::sqrt(square / static_cast<double>(run.map.known->tags.size())), 0.03);
  EXPECT_GT(run.map_nees, 0.2);
  EXPECT_LT(run.map_nees, 3.0);
  for (std::size_t k = 0; k < robots.size(); ++k) {
    EXPECT_GT(shifted[k], 3) << "robot " << k << " follows the map";
    EXPECT_GT(placed[k], 100);
  }
}

TEST(MapRefinerSimulation, AFrozenMapMovesNobody) {
  const auto robots = two_robots_on_a_ring();
  FilterChoice choice;
  choice.filter = "world";
  choice.refine_period_s = 2;  // asked for, but the map is frozen
  int placed = 0;
  int shifted = 0;
  choice.listen = [&](std::size_t, const BodyUpdate& update, const TagMap&) {
    shifted += update.report.map_shift ? 1 : 0;
    placed += update.is_placed() ? 1 : 0;
  };
  (void)run_together(std::span(robots).first(1), choice);
  EXPECT_EQ(shifted, 0);
  EXPECT_GT(placed, 100);
}

TEST(MapRefinerSimulation, NothingIsRefinedWhenItIsTurnedOff) {
  const auto robots = two_robots_on_a_ring();
  FilterChoice choice;
  choice.refine_period_s = 0;
  choice.filter = "world";
  choice.live = true;
  bool has_segment = false;
  choice.listen = [&](std::size_t, const BodyUpdate& update, const TagMap&) {
    has_segment = has_segment || update.segment != nullptr;
  };
  const TogetherRun run = run_together(std::span(robots).first(1), choice);
  EXPECT_EQ(run.map.known, nullptr);
  EXPECT_FALSE(has_segment);
}

}  // namespace
}  // namespace fiducap
