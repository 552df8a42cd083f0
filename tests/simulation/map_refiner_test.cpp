// The map of a session that is refined while it is made: pipelines, builder and refiner as in the
// server, in virtual time.
#include "mapping/map_refiner.hpp"

#include <gtest/gtest.h>

#include <map>

#include "base/pose.hpp"
#include "mapping/tag_map.hpp"
#include "simulation/filter_run.hpp"
#include "simulation/published_steps.hpp"

namespace fiducap {
namespace {

class MapRefinerSimulation : public testing::Test {
 protected:
  MapRefinerSimulation() {
    for (std::uint64_t k = 0; k < 2; ++k)
      robots_.push_back(simulate({.world = "ring",
                                  .seconds = 40,
                                  .seed = 5 + 100 * k,
                                  .from = 0.1 * static_cast<double>(k),
                                  .share = 0.25}));
    for (EstimationData& robot : robots_) robot.reference_tag = robots_.front().reference_tag;
    choice_.listen = [this](std::size_t body, const BodyUpdate& update, const TagMap&) {
      shifted_[body] += update.report.map_shift ? 1 : 0;
      placed_[body] += update.is_placed() ? 1 : 0;
    };
  }

  std::vector<EstimationData> robots_;
  FilterChoice choice_{.filter = "world", .live = true};
  std::vector<int> shifted_ = std::vector<int>(2);  ///< Images at which the map moved, by body.
  std::vector<int> placed_ = std::vector<int>(2);
};

TEST_F(MapRefinerSimulation, TwoRobotsMakeOneConsistentMap) {
  const TogetherRun run = run_together(robots_, choice_);
  ASSERT_NE(run.map.known, nullptr);
  EXPECT_GT(run.map.tags.size(), 25U);
  EXPECT_FALSE(run.map.known->pairs.empty());
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
  for (const KnownTag& tag : run.map.known->tags)
    points.emplace_back(tag.X_WT.p, robots_.front().tag(tag.tag_id)->X_WT.p);
  const Pose level = fit_yaw_and_shift(points);
  double square = 0;
  for (const auto& [found, truth] : points) square += (level * found - truth).squaredNorm();
  EXPECT_LT(std::sqrt(square / static_cast<double>(points.size())), 0.03);
  EXPECT_GT(run.map_nees, 0.2);
  EXPECT_LT(run.map_nees, 3.0);
  for (std::size_t k = 0; k < robots_.size(); ++k) {
    EXPECT_GT(shifted_[k], 3) << "robot " << k << " follows the map";
    EXPECT_GT(placed_[k], 100);
  }
}

TEST_F(MapRefinerSimulation, FrozenMapShiftsNoBody) {
  choice_.live = false;
  (void)run_together(std::span(robots_).first(1), choice_);
  EXPECT_EQ(shifted_[0], 0);
  EXPECT_GT(placed_[0], 100);
}

TEST(OneBodyWithItsMap, NoPublishedPoseJumpsAndTheFirstIsNotLater) {
  constexpr double kMost_sigma = 1.0;  // of a frame beyond the motion: CorrectionRamp
  for (const char* world : {"table", "sparse"}) {
    const EstimationData data = simulate({.world = world, .seconds = 20, .seed = 7});
    std::map<bool, int> first;  // image with the first pose that is shown, by `frozen`
    for (const bool frozen : {false, true}) {
      FilterChoice choice{.filter = "world", .live = true, .frozen = frozen};
      const PipelineSetup setup = pipeline_of(data, choice);
      PublishedSteps steps(data, setup.sensors, setup.estimator, {.seconds = 2});
      int images = 0;
      int shifted = 0;
      choice.listen = [&](std::size_t, const BodyUpdate& update, const TagMap&) {
        ++images;
        shifted += update.report.map_shift ? 1 : 0;
        if (update.shown()) first.try_emplace(frozen, images);
        steps.take(update);
      };
      (void)run_filter(data, choice);
      EXPECT_EQ(shifted > 3, !frozen) << world;
      EXPECT_GT(steps.figures().valid, steps.figures().frames / 2) << world;
      EXPECT_LT(steps.figures().position, kMost_sigma) << world;
      EXPECT_LT(steps.figures().attitude, kMost_sigma) << world;
    }
    EXPECT_EQ(first.at(false), first.at(true)) << world;
  }
}

TEST_F(MapRefinerSimulation, OneRobotMakesAConsistentMap) {
  const TogetherRun run = run_together(std::span(robots_).first(1), choice_);
  ASSERT_NE(run.map.known, nullptr);
  EXPECT_GT(run.map.tags.size(), 15U);
  EXPECT_GT(run.map_nees, 0.2);
  EXPECT_LT(run.map_nees, 3.0);
  EXPECT_GT(shifted_[0], 3);
}

}  // namespace
}  // namespace fiducap
