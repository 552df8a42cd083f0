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

class ClockSyncTest : public testing::Test {
 protected:
  /// One exchange with these delays to the autopilot and back.
  void exchange(Duration there, Duration back) {
    const auto request = sync_.next_request(now_);
    ASSERT_TRUE(request);
    now_ += there;
    const Timesync reply{to_ns(now_ + kShift), request->ts1_ns};
    now_ += back;
    ASSERT_TRUE(sync_.accept_reply(reply, now_));
  }
  ClockSync sync_;
  Instant now_ = kStart;
};

TEST_F(ClockSyncTest, FindsTheOffsetOfAFastSymmetricLink) {
  exchange(1ms, 1ms);
  const auto offset = sync_.offset(now_);
  ASSERT_TRUE(offset);
  EXPECT_EQ(offset->to_autopilot, kShift);
  EXPECT_EQ(offset->bound, 1ms);
  EXPECT_TRUE(sync_.offset(now_ + 9s));
  EXPECT_FALSE(sync_.offset(now_ + 11s)) << "too old";
}

TEST_F(ClockSyncTest, ErrorStaysWithinTheBound) {
  std::mt19937 random(7);
  std::exponential_distribution<double> delay_s(1 / 0.005);
  for (int i = 0; i < 200; ++i) {
    exchange(from_seconds(0.001 + delay_s(random)), from_seconds(0.001 + delay_s(random)));
    const auto offset = sync_.offset(now_);
    ASSERT_TRUE(offset);
    EXPECT_LE(std::abs((offset->to_autopilot - kShift).count()), offset->bound.count());
    now_ += 1s;
  }
}

TEST_F(ClockSyncTest, UsesTheFastestOfTheLastReplies) {
  exchange(1ms, 1ms);
  now_ += 100ms;
  exchange(1ms, 200ms);
  EXPECT_EQ(sync_.offset(now_)->to_autopilot, kShift);
}

TEST_F(ClockSyncTest, RequestsOftenAtFirstThenOncePerSecond) {
  int requests = 0;
  for (int i = 0; i < 1000; ++i, now_ += 10ms) {
    const auto request = sync_.next_request(now_);
    if (!request) continue;
    ++requests;
    sync_.accept_reply({to_ns(now_ + kShift), request->ts1_ns}, now_);
  }
  EXPECT_EQ(requests, 16 + 9);  // from 0 to 1.5 s, then at 1.6, 2.6, … 9.6 s
}

TEST_F(ClockSyncTest, AcceptsOneReplyToEachOfItsRequests) {
  const auto request = sync_.next_request(kStart);
  ASSERT_TRUE(request);
  EXPECT_FALSE(sync_.accept_reply({1, request->ts1_ns + 1}, kStart + 1ms)) << "no request";
  EXPECT_FALSE(sync_.accept_reply({1, request->ts1_ns}, kStart + 2s)) << "too late";
  EXPECT_TRUE(sync_.accept_reply({1, request->ts1_ns}, kStart + 1ms));
  EXPECT_FALSE(sync_.accept_reply({1, request->ts1_ns}, kStart + 1ms)) << "again";
}

TEST_F(ClockSyncTest, AcceptsExtremeTimes) {
  using Limits = std::numeric_limits<std::int64_t>;
  for (const auto time_ns : {Limits::min(), Limits::max()}) {
    ClockSync sync;
    const auto request = sync.next_request(kStart);
    ASSERT_TRUE(request);
    EXPECT_TRUE(sync.accept_reply({time_ns, request->ts1_ns}, kStart + 1ms));
    EXPECT_TRUE(sync.offset(kStart + 1ms));
  }
}

TEST_F(ClockSyncTest, CorrectsAnOlderReplyByTheDrift) {
  const auto request = sync_.next_request(now_);
  ASSERT_TRUE(request);
  ASSERT_TRUE(sync_.accept_reply({to_ns(now_ + 4s), request->ts1_ns}, now_));
  EXPECT_EQ(sync_.offset(now_ + 8s)->to_autopilot, 4s);
  EXPECT_EQ(sync_.offset(now_ + 8s, 50e-6)->to_autopilot, 4s + 400us);
}

}  // namespace
}  // namespace fiducap::mavlink
