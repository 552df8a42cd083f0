#include "streaming/vicon/frame_board.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace fiducap::vicon {
namespace {

Instant at_s(double s) { return instant_from_ns(std::llround(s * 1e9)); }

TEST(ViconFrameNumbers, AreTimeTimesRateAlsoWhenTicksComeLate) {
  for (const double rate_hz : {25.0, 100.0, 200.0, 1000.0}) {
    FrameNumbers numbers;
    std::mt19937 random(3);
    std::uniform_real_distribution<double> late(0.0, 0.7);  // of a period
    for (int i = 0; i < 5000; ++i) {
      const double tick = i + (i == 0 ? 0.0 : late(random));
      EXPECT_EQ(numbers.next(at_s(5 + tick / rate_hz), rate_hz), static_cast<std::uint32_t>(i))
          << rate_hz;
    }
  }
}

TEST(ViconFrameNumbers, AreDueEvenlySpacedHoweverLateTheTicks) {
  FrameNumbers numbers;
  (void)numbers.next(at_s(3.0), 200);
  EXPECT_EQ(numbers.due(), at_s(3.0));
  (void)numbers.next(at_s(3.0081), 200);
  EXPECT_EQ(numbers.due(), at_s(3.005));
  (void)numbers.next(at_s(3.0101), 200);
  EXPECT_EQ(numbers.due(), at_s(3.010));
  (void)numbers.next(at_s(3.05), 400);
  EXPECT_EQ(numbers.due(), at_s(3.05)) << "another rate, another beginning";
}

TEST(ViconFrameNumbers, ALateFirstTickShiftsNothingForGood) {
  FrameNumbers numbers;
  EXPECT_EQ(numbers.next(at_s(1.006), 100), 0u);  // 6 ms late
  for (std::uint32_t i = 1; i < 100; ++i)
    EXPECT_LE(std::abs(static_cast<int>(numbers.next(at_s(1 + i * 0.01), 100) - i)), 1);
  EXPECT_EQ(numbers.next(at_s(2.006), 100), 100u);
}

TEST(ViconFrameNumbers, AMissedFrameLeavesAGap) {
  FrameNumbers numbers;
  EXPECT_EQ(numbers.next(at_s(1.00), 100), 0u);
  EXPECT_EQ(numbers.next(at_s(1.01), 100), 1u);
  EXPECT_EQ(numbers.next(at_s(1.05), 100), 5u);
}

TEST(ViconFrameNumbers, NeverStandStillOrGoBack) {
  FrameNumbers numbers;
  const auto first = numbers.next(at_s(1.0), 100);
  const auto second = numbers.next(at_s(1.0), 100);
  const auto third = numbers.next(at_s(0.5), 100);
  EXPECT_EQ(second, first + 1);
  EXPECT_EQ(third, first + 2);
}

TEST(ViconFrameNumbers, GoOnWhenTheRateChanges) {
  FrameNumbers numbers;
  (void)numbers.next(at_s(1.0), 100);
  EXPECT_EQ(numbers.next(at_s(1.01), 100), 1u);
  EXPECT_EQ(numbers.next(at_s(1.02), 200), 2u);
  EXPECT_EQ(numbers.next(at_s(1.03), 200), 4u);
}

TEST(ViconFrameNumbers, StayWithinAnInt) {
  FrameNumbers numbers;
  (void)numbers.next(at_s(0), 1000);
  EXPECT_EQ(numbers.next(instant_from_ns(2'147'483'647'000'000), 1000), 0x7fffffffu);
  EXPECT_EQ(numbers.next(instant_from_ns(2'147'483'648'000'000), 1000), 0u);
}

}  // namespace
}  // namespace fiducap::vicon
