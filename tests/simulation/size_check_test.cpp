// Misprinted tags before a whole filter, which rejects what it cannot understand. Seeds by the
// dozen: fiducap_estimation_bench sizes.
#include <gtest/gtest.h>

#include "simulation/size_run.hpp"

namespace fiducap {
namespace {

constexpr double kSeconds = 40.0;
constexpr double kRatio = 0.03;

SizeRun run(const Misprint& misprint, bool has_imu = true) {
  return run_sizes({.world = "table", .seconds = kSeconds, .seed = 2, .has_imu = has_imu}, "world",
                   misprint);
}

TEST(SizeCheckSimulation, DoesNotReportRightSizes) {
  for (const bool has_imu : {true, false}) {
    const SizeRun all = run({"right"}, has_imu);
    EXPECT_TRUE(all.said.empty());
    EXPECT_TRUE(all.rejection_said_at_s.empty());
  }
}

TEST(SizeCheckSimulation, SaysThatAllTagsAreAQuarterLargerThoughTheFilterIsTorn) {
  const SizeRun all = run({"all", 1.25});
  ASSERT_FALSE(all.said.empty());
  EXPECT_FALSE(all.said.back().finding.tag_id);
  EXPECT_NEAR(all.said.back().finding.ratio, 1.25, kRatio);
}

TEST(SizeCheckSimulation, NamesTheOneTagThatIsTenPercentSmaller) {
  const SizeRun one = run({"one", 1, 0.9});
  ASSERT_FALSE(one.said.empty());
  for (const auto& said : one.said) EXPECT_EQ(said.finding.tag_id, one.tag);
  EXPECT_NEAR(one.said.back().finding.ratio, 0.9, kRatio);
}

TEST(SizeCheckSimulation, IsSilentAboutStampsThatAreOff) {
  const SizeRun off = run({"stamps", 1, 1, [](simulation::FaultConfig& f, int, double) {
                             f.image_stamp_error_s = 0.05;
                           }});
  EXPECT_TRUE(off.said.empty());
  EXPECT_TRUE(off.rejection_said_at_s.empty());
}

}  // namespace
}  // namespace fiducap
