#include "capture/ros/stamp_mapper.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <random>

namespace fiducap::dds {
namespace {

using namespace std::chrono_literals;

constexpr Instant kStart = instant_from_ns(1'000'000'000'000);
constexpr std::int64_t kUtc = 1'700'000'000'000'000'000;  // at kStart

std::int64_t utc_at(Instant at) { return kUtc + (at - kStart).count(); }

TEST(StampMapper, SynchronisedStampsAreTakenAsTheyAre) {
  StampMapper mapper(true);
  const Instant exposed = kStart + 1s;
  const Instant arrived = exposed + 30ms;
  EXPECT_EQ(mapper.place(utc_at(exposed), arrived, utc_at(arrived)), exposed);
}

TEST(StampMapper, StampsFromTheFutureOrThePastAreRefused) {
  StampMapper mapper(true);
  EXPECT_FALSE(mapper.place(utc_at(kStart + 1s), kStart, kUtc));
  EXPECT_FALSE(mapper.place(utc_at(kStart - 10s), kStart, kUtc));
  EXPECT_FALSE(mapper.place(-1, kStart, kUtc));
  EXPECT_FALSE(mapper.place(std::numeric_limits<std::int64_t>::max(), kStart, kUtc));
  EXPECT_EQ(mapper.refused(), 4u);
  EXPECT_TRUE(mapper.place(kUtc, kStart, kUtc)) << "one liar does not spoil the rest";
}

TEST(StampMapper, AClockThatIsNotOursIsFoundOutAndPlacedByArrival) {
  StampMapper mapper(true);
  Instant now = kStart;
  int refused = 0;
  for (int i = 0; i < 60; ++i, now += 5ms) {
    if (!mapper.place((now - kStart).count(), now + 1ms, utc_at(now + 1ms)))
      ++refused;  // simulated time, from 0
  }
  EXPECT_EQ(refused, 50);
  EXPECT_TRUE(mapper.by_arrival());
  EXPECT_EQ(mapper.place((now - kStart).count(), now + 1ms, utc_at(now)), now + 1ms);
}

TEST(StampMapper, BySlowMessagesArrivalIsNotDelayed) {
  StampMapper mapper(false);
  std::mt19937 random(3);
  std::exponential_distribution<double> late_s(1 / 0.003);
  Instant now = kStart;
  for (int i = 0; i < 2000; ++i, now += 5ms) {
    const Instant arrived = now + 1ms + from_seconds(late_s(random));
    const auto placed = mapper.place(std::int64_t{i} * 5'000'000, arrived, 0);
    ASSERT_TRUE(placed);
    if (i < 200) continue;
    EXPECT_GE(*placed, now + 1ms);          // nobody knows the quickest way
    EXPECT_LE(*placed, now + 1ms + 200us);  // but the quickest of two hundred is close to it
  }
}

TEST(StampMapper, WhatLiesBetweenImageAndReadingStaysAsMeasured) {
  StampMapper mapper(false);
  Instant now = kStart;
  for (int i = 0; i < 100; ++i, now += 5ms) (void)mapper.place(std::int64_t{i} * 5'000'000, now, 0);
  const auto reading = mapper.place(500'000'000, now, 0);
  const auto image =
      mapper.place(480'000'000, now + 40ms, 0);  // exposed 20 ms before, came 60 ms after
  ASSERT_TRUE(reading && image);
  EXPECT_EQ(*reading - *image, 20ms);
}

TEST(StampMapper, FollowsAClockThatRunsWrong) {
  StampMapper mapper(false);
  Instant now = kStart;
  constexpr double kDrift = 100e-6;  // slow by this
  for (int i = 0; i < 200'000; ++i, now += 5ms) {
    const auto stamp =
        static_cast<std::int64_t>(static_cast<double>((now - kStart).count()) * (1 - kDrift));
    const auto placed = mapper.place(stamp, now, 0);
    ASSERT_TRUE(placed);
    EXPECT_LE(now - *placed, 2ms + 1us);  // 20 s of drift
  }
}

TEST(StampMapper, AStampFarAheadDoesNotMoveTheOthers) {
  StampMapper mapper(false);
  Instant now = kStart;
  for (int i = 0; i < 100; ++i, now += 5ms) (void)mapper.place(std::int64_t{i} * 5'000'000, now, 0);
  EXPECT_FALSE(mapper.place(500'000'000 + 3'600'000'000'000, now, 0));
  EXPECT_EQ(mapper.place(500'000'000, now, 0), now);
}

}  // namespace
}  // namespace fiducap::dds
