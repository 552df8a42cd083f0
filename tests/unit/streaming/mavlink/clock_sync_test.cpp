#include "middleware/mavlink/clock_sync.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <limits>
#include <random>

namespace fiducap::mavlink {
namespace {

using namespace std::chrono_literals;

constexpr Instant kStart = instant_from_ns(1'000'000'000'000);
constexpr Duration kShift = 123s + 456ms;  // of the autopilot's clock

/// One exchange: `there` on the way to it, `back` on the way to us.
void exchange(ClockSync& sync, Instant& now, Duration there, Duration back) {
  const auto request = sync.next_request(now);
  ASSERT_TRUE(request);
  const Instant asked = now;
  now += there;
  const Timesync reply{to_ns(now + kShift), request->ts1_ns};
  now += back;
  ASSERT_TRUE(sync.accept_reply(reply, now));
}

TEST(ClockSync, FindsTheOffsetOfAQuickSymmetricLink) {
  ClockSync sync;
  Instant now = kStart;
  exchange(sync, now, 1ms, 1ms);
  const auto offset = sync.offset(now);
  ASSERT_TRUE(offset);
  EXPECT_EQ(offset->to_autopilot, kShift);
  EXPECT_EQ(offset->bound, 1ms);
}

TEST(ClockSync, TheTruthIsNeverFurtherAwayThanTheDoubt) {
  std::mt19937 random(7);
  std::exponential_distribution<double> delay_s(1 / 0.005);
  ClockSync sync;
  Instant now = kStart;
  for (int i = 0; i < 200; ++i) {
    exchange(sync, now, from_seconds(0.001 + delay_s(random)),
             from_seconds(0.001 + delay_s(random)));
    const auto offset = sync.offset(now);
    ASSERT_TRUE(offset);
    EXPECT_LE(std::abs((offset->to_autopilot - kShift).count()), offset->bound.count());
    now += 1s;
  }
}

TEST(ClockSync, TheQuickestAnswerOfTheLastOnesCounts) {
  ClockSync sync;
  Instant now = kStart;
  exchange(sync, now, 1ms, 1ms);
  now += 100ms;
  exchange(sync, now, 1ms, 200ms);
  EXPECT_EQ(sync.offset(now)->to_autopilot, kShift);
}

TEST(ClockSync, AsksOftenAtFirstAndOnceASecondLater) {
  ClockSync sync;
  Instant now = kStart;
  int asked = 0;
  for (int i = 0; i < 1000; ++i, now += 10ms) {
    const auto request = sync.next_request(now);
    if (!request) continue;
    ++asked;
    sync.accept_reply({to_ns(now + kShift), request->ts1_ns}, now);
  }
  EXPECT_EQ(asked, 16 + 9);  // from 0 to 1.5 s, then at 1.6, 2.6, … 9.6 s
}

TEST(ClockSync, BelievesOnlyAnswersToItsOwnQuestionsAndOnlyOnce) {
  ClockSync sync;
  const auto request = sync.next_request(kStart);
  ASSERT_TRUE(request);
  EXPECT_FALSE(sync.accept_reply({1, request->ts1_ns + 1}, kStart + 1ms)) << "never asked";
  EXPECT_FALSE(sync.accept_reply({1, request->ts1_ns}, kStart + 2s)) << "too late";
  EXPECT_TRUE(sync.accept_reply({1, request->ts1_ns}, kStart + 1ms));
  EXPECT_FALSE(sync.accept_reply({1, request->ts1_ns}, kStart + 1ms)) << "again";
}

TEST(ClockSync, AClockThatSaysAnythingDoesNoHarm) {
  for (const auto said :
       {std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max()}) {
    ClockSync sync;
    const auto request = sync.next_request(kStart);
    ASSERT_TRUE(request);
    EXPECT_TRUE(sync.accept_reply({said, request->ts1_ns}, kStart + 1ms));
    EXPECT_TRUE(sync.offset(kStart + 1ms));
  }
}

TEST(ClockSync, ForgetsAfterTenSecondsOfSilence) {
  ClockSync sync;
  Instant now = kStart;
  exchange(sync, now, 1ms, 1ms);
  EXPECT_TRUE(sync.offset(now + 9s));
  EXPECT_FALSE(sync.offset(now + 11s));
}

TEST(ClockSync, AnOlderAnswerIsCarriedOnByTheDrift) {
  ClockSync sync;
  const Instant asked = instant_from_ns(5'000'000'000);
  const auto request = sync.next_request(asked);
  ASSERT_TRUE(request);
  ASSERT_TRUE(sync.accept_reply({9'000'000'000, request->ts1_ns}, asked));
  const Instant later = asked + std::chrono::seconds(8);
  EXPECT_EQ(sync.offset(later)->to_autopilot, std::chrono::seconds(4));
  EXPECT_EQ(sync.offset(later, 50e-6)->to_autopilot,
            std::chrono::seconds(4) + std::chrono::microseconds(400));
}

}  // namespace
}  // namespace fiducap::mavlink
