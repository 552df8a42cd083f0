// Followed image points in a rendered room with texture.
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
    for_each_image(all, [&](CornerFrame& image) {
      if (to_seconds(image.exposed_at - first) > kGapBegin_s) image.tags.clear();
    });
    return all;
  }();
  return data;
}

FilterRun run_with_landmarks(const EstimationData& data, bool landmarks) {
  FilterChoice choice{.filter = "world"};
  choice.estimator.landmarks = landmarks;
  return run_filter(data, choice);
}

TEST(Landmarks, CarryABodyThroughSecondsWithoutTags) {
  const FilterRun with = run_with_landmarks(hall_with_gap(), true);
  const FilterRun without = run_with_landmarks(hall_with_gap(), false);
  ASSERT_GT(with.landmarks_used, 100);
  ASSERT_FALSE(with.at.back().has_tags);
  // Measured over seeds: a fifth of the error after 5 s.
  EXPECT_LT(with.at.back().sigma_m, 0.5 * without.at.back().sigma_m);
  EXPECT_LT(with.at.back().level_position_m, 4 * with.at.back().sigma_m);
  EXPECT_LT(with.at.back().level_position_m, 0.1);
  EXPECT_GT(without.at.back().sigma_m, 0.1);
  EXPECT_LT(std::abs(with.landmark_nis / static_cast<double>(with.landmark_nis_dof)), 1.2);
}

TEST(Landmarks, DoNotChangeTheResultWhenUnused) {
  EstimationData bare = hall_with_gap();
  for_each_image(bare, [](CornerFrame& image) { image.points.clear(); });
  const FilterRun switched_off = run_with_landmarks(hall_with_gap(), false);
  const FilterRun no_points = run_with_landmarks(bare, true);
  const FilterRun neither = run_with_landmarks(bare, false);
  ASSERT_EQ(switched_off.at.size(), neither.at.size());
  for (std::size_t i = 0; i < switched_off.at.size(); ++i) {
    EXPECT_EQ(switched_off.at[i].position_m, neither.at[i].position_m);
    EXPECT_EQ(switched_off.at[i].sigma_m, neither.at[i].sigma_m);
  }
  // Room for clones changes the order of sums, nothing else.
  ASSERT_EQ(no_points.at.size(), neither.at.size());
  EXPECT_NEAR(no_points.at.back().position_m, neither.at.back().position_m, 1e-6);
}

}  // namespace
}  // namespace fiducap
