// Followed image points in a rendered room with texture: what they are worth, and that nothing
// changes without them.
#include <gtest/gtest.h>

#include <cmath>

#include "simulation/filter_run.hpp"

namespace fiducap {
namespace {

constexpr double kGapBegin_s = 8.0;
constexpr double kGapEnd_s = 14.0;

/// A hall whose tags are out of sight for the last seconds.
const EstimationData& hall_with_gap() {
  static const EstimationData data = [] {
    EstimationData all = simulate({.world = "hall", .seconds = kGapEnd_s, .texture = "sharp"});
    const Instant first = time_of(all.samples.front());
    for (SensorSample& sample : all.samples) {
      auto* image = std::get_if<CornerFrame>(&sample);
      if (image != nullptr && to_seconds(image->exposed_at - first) > kGapBegin_s)
        image->tags.clear();
    }
    return all;
  }();
  return data;
}

FilterRun run(const EstimationData& data, bool landmarks) {
  FilterChoice choice;
  choice.filter = "world";
  choice.knowledge.letter = 'A';
  choice.estimator.landmarks = landmarks;
  return run_filter(data, choice);
}

TEST(Landmarks, CarryABodyThroughSecondsWithoutTagsAndSayHowWell) {
  const FilterRun with = run(hall_with_gap(), true);
  const FilterRun without = run(hall_with_gap(), false);
  ASSERT_GT(with.landmarks_used, 100);
  ASSERT_FALSE(with.at.back().has_tags);
  // Measured over seeds: a fifth of the error after 5 s.
  EXPECT_LT(with.at.back().sigma_m, 0.5 * without.at.back().sigma_m);
  EXPECT_LT(with.at.back().level_position_m, 4 * with.at.back().sigma_m);
  EXPECT_LT(with.at.back().level_position_m, 0.1);
  EXPECT_GT(without.at.back().sigma_m, 0.1);
  EXPECT_LT(std::abs(with.landmark_nis / static_cast<double>(with.landmark_nis_dof)), 1.2);
}

TEST(Landmarks, WithoutThemTheResultIsTheSameToTheLastBit) {
  EstimationData bare = hall_with_gap();
  for (SensorSample& sample : bare.samples) {
    if (auto* image = std::get_if<CornerFrame>(&sample)) image->points.clear();
  }
  const FilterRun switched_off = run(hall_with_gap(), false);
  const FilterRun no_points = run(bare, true);
  const FilterRun never_heard_of = run(bare, false);
  ASSERT_EQ(switched_off.at.size(), never_heard_of.at.size());
  for (std::size_t i = 0; i < switched_off.at.size(); ++i) {
    EXPECT_EQ(switched_off.at[i].position_m, never_heard_of.at[i].position_m);
    EXPECT_EQ(switched_off.at[i].sigma_m, never_heard_of.at[i].sigma_m);
  }
  // Room for clones changes the order of sums, nothing else.
  ASSERT_EQ(no_points.at.size(), never_heard_of.at.size());
  EXPECT_NEAR(no_points.at.back().position_m, never_heard_of.at.back().position_m, 1e-6);
}

}  // namespace
}  // namespace fiducap
