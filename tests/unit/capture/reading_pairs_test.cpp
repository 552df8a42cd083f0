#include "capture/reading_pairs.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

using Timed = ReadingPairs::Timed;

Timed timed(std::int64_t stamp_ns, double value) {
  return {stamp_ns, Eigen::Vector3d::Constant(value)};
}

TEST(ReadingPairs, InterpolatesTheAccelerometerAtTheTimesOfTheGyro) {
  ReadingPairs pairs;
  for (const auto& [at, value] : {std::pair(0, 0.0), std::pair(10, 1.0), std::pair(20, 4.0)})
    pairs.add_accel(timed(at, value));
  for (const std::int64_t at : {0, 5, 10, 15}) pairs.add_gyro(timed(at, static_cast<double>(at)));
  for (const auto& [at, expected] :
       {std::pair(0, 0.0), std::pair(5, 0.5), std::pair(10, 1.0), std::pair(15, 2.5)}) {
    const auto pair = pairs.take().value();
    EXPECT_EQ(pair.stamp_ns, at);
    EXPECT_EQ(pair.w.x(), at);
    EXPECT_DOUBLE_EQ(pair.f.z(), expected);
  }
  EXPECT_FALSE(pairs.take());
}

TEST(ReadingPairs, HoldsAGyroReadingUntilTheAccelerometer) {
  ReadingPairs pairs;
  pairs.add_accel(timed(0, 0));
  pairs.add_gyro(timed(5, 1));
  EXPECT_FALSE(pairs.take());
  EXPECT_FALSE(pairs.gyro_is_behind());
  pairs.add_accel(timed(10, 1));
  EXPECT_TRUE(pairs.gyro_is_behind());
  EXPECT_TRUE(pairs.take());
}

TEST(ReadingPairs, DropsReadingsBeforeTheFirstPair) {
  ReadingPairs pairs;
  pairs.add_gyro(timed(5, 1));
  pairs.add_gyro(timed(12, 2));
  pairs.add_accel(timed(10, 1));
  pairs.add_accel(timed(20, 2));
  const auto pair = pairs.take().value();
  EXPECT_EQ(pair.stamp_ns, 12);
  EXPECT_EQ(pairs.dropped(), 1u);
}

TEST(ReadingPairs, BoundsTheReadingsOfASilentDevice) {
  ReadingPairs pairs;
  for (int i = 0; i < 10'000; ++i) pairs.add_gyro(timed(i, 1));
  EXPECT_FALSE(pairs.take());
  EXPECT_EQ(pairs.dropped(), 10'000u - 256);
}

TEST(ReadingPairs, DropsStampsThatDoNotIncrease) {
  ReadingPairs pairs;
  for (const std::int64_t at : {10, 10, 5}) pairs.add_accel(timed(at, 1));
  EXPECT_EQ(pairs.dropped(), 2u);
}

TEST(MountMatrix, IsReadInTheFormOfTheKernel) {
  const auto matrix = parse_mount_matrix("0, 1, 0; -1, 0, 0; 0, 0, 1\n");
  ASSERT_TRUE(matrix);
  EXPECT_EQ(*matrix * Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(2, -1, 3));
  EXPECT_TRUE(
      parse_mount_matrix("1.000000, 0.000000, 0.000000; 0, 0.707, 0.707; 0, -0.707, 0.707"));
}

TEST(MountMatrix, RefusesWhatIsNoRotation) {
  for (const char* text :
       {"", "1, 0, 0; 0, 1, 0; 0, 0", "1, 0, 0; 0, 1, 0; 0, 0, 1, 5", "2, 0, 0; 0, 1, 0; 0, 0, 1",
        "a, 0, 0; 0, 1, 0; 0, 0, 1", "nan, 0, 0; 0, 1, 0; 0, 0, 1", "0, 0, 0; 0, 0, 0; 0, 0, 0"})
    EXPECT_FALSE(parse_mount_matrix(text)) << text;
}

}  // namespace
}  // namespace fiducap
