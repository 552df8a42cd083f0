#include "capture/import/imu_pairs.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

constexpr Duration kGap = std::chrono::milliseconds(100);

VectorReading reading(std::int64_t ms, double x) { return {ms * 1'000'000, {x, 0, 0}}; }

TEST(ImuPairs, TheAccelerometerIsInterpolatedAtTheTimesOfTheGyro) {
  const auto pairs = pair_readings({reading(10, 1), reading(15, 2), reading(20, 3)},
                                   {reading(10, 100), reading(20, 200)}, kGap);
  ASSERT_EQ(pairs.samples.size(), 3u);
  EXPECT_EQ(pairs.samples[0].f_B.x(), 100);
  EXPECT_DOUBLE_EQ(pairs.samples[1].f_B.x(), 150);
  EXPECT_EQ(pairs.samples[1].w_WB_B.x(), 2);
  EXPECT_EQ(pairs.samples[2].f_B.x(), 200);
}

TEST(ImuPairs, NothingIsMadeUpBeforeBehindOrInGaps) {
  const auto pairs =
      pair_readings({reading(5, 1), reading(60, 2), reading(250, 3), reading(900, 4)},
                    {reading(10, 1), reading(100, 1), reading(400, 1)}, kGap);
  ASSERT_EQ(pairs.samples.size(), 1u);
  EXPECT_EQ(to_ns(pairs.samples[0].sampled_at), 60'000'000);
  EXPECT_EQ(pairs.alone, 3u);
}

TEST(ImuPairs, ReadingsAreSortedAndComeOnce) {
  std::vector<VectorReading> readings{reading(2, 2), reading(1, 1), reading(2, 3), reading(3, 3)};
  EXPECT_EQ(put_in_order(readings), 1u);
  ASSERT_EQ(readings.size(), 3u);
  EXPECT_EQ(readings[1].v.x(), 2) << "the first of two stays";
}

}  // namespace
}  // namespace fiducap
