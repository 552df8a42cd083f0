#include "streaming/conventions/send_schedule.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace fiducap {
namespace {

using namespace std::chrono_literals;

int sent_of(int frames, double frame_rate_hz, double rate_hz) {
  SendSchedule schedule(rate_hz);
  int sent = 0;
  for (int i = 0; i < frames; ++i) {
    sent += schedule.is_due(instant_from_ns(7) + from_seconds(i / frame_rate_hz), frame_rate_hz)
                ? 1
                : 0;
  }
  return sent;
}

TEST(SendSchedule, MeetsRatesThatDoNotDivideTheFrameRateInTheMean) {
  EXPECT_EQ(sent_of(10'000, 100, 50), 5000);
  EXPECT_NEAR(sent_of(10'000, 100, 30), 3000, 1);
  EXPECT_NEAR(sent_of(10'000, 240, 50), 2083, 1);
}

TEST(SendSchedule, SendsEveryFrameWhenFramesAreSlower) { EXPECT_EQ(sent_of(100, 20, 50), 100); }

TEST(SendSchedule, DoesNotMakeUpForAGap) {
  SendSchedule schedule(10);
  Instant at = instant_from_ns(0);
  EXPECT_TRUE(schedule.is_due(at, 100));
  at += 10s;
  EXPECT_TRUE(schedule.is_due(at, 100));
  EXPECT_FALSE(schedule.is_due(at + 10ms, 100));
  EXPECT_TRUE(schedule.is_due(at + 100ms, 100));
}

}  // namespace
}  // namespace fiducap
