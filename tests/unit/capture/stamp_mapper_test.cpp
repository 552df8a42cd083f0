#include "capture/stamp_mapper.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <random>

namespace fiducap {
namespace {

using namespace std::chrono_literals;

constexpr Instant kStart = instant_from_ns(1'000'000'000'000);
constexpr std::int64_t kUtc = 1'700'000'000'000'000'000;  // at kStart

std::int64_t utc_at(Instant at) { return kUtc + (at - kStart).count(); }

TEST(StampMapper, RefusesStampsOfTheFutureAndThePastAndKeepsOthers) {
  StampMapper mapper(true);
  for (const std::int64_t stamp : {utc_at(kStart + 1s), utc_at(kStart - 10s), std::int64_t{-1},
                                   std::numeric_limits<std::int64_t>::max()})
    EXPECT_FALSE(mapper.place(stamp, kStart, kUtc)) << stamp;
  EXPECT_EQ(mapper.refused(), 4u);
  const Instant exposed = kStart + 1s;
  const Instant arrived = exposed + 30ms;
  EXPECT_EQ(mapper.place(utc_at(exposed), arrived, utc_at(arrived)), exposed);
}

TEST(StampMapper, DetectsAnotherClockAndUsesArrivals) {
  StampMapper mapper(true);
  Instant now = kStart;
  int refused = 0;
  for (int i = 0; i < 60; ++i, now += 5ms)  // simulated time, from 0
    refused += mapper.place((now - kStart).count(), now + 1ms, utc_at(now + 1ms)) ? 0 : 1;
  EXPECT_EQ(refused, 50);
  EXPECT_TRUE(mapper.by_arrival());
  EXPECT_EQ(mapper.place((now - kStart).count(), now + 1ms, utc_at(now)), now + 1ms);
}

/// A sender whose clock drifts, behind a link that delays by `quickest` and at random.
struct DriftingSender {
  double drift;
  double mean_delay_s;
  Duration quickest{1ms};
  Duration period{5ms};
  std::mt19937 random{5};
  std::int64_t started_with_ns{7'000'000'000};
  Instant started{kStart};
  int tick{0};

  struct Message {
    Instant measured;
    std::int64_t stamp_ns;
    Instant arrived;
    /// Microseconds, in 32 bits.
    [[nodiscard]] std::uint64_t count() const {
      return static_cast<std::uint64_t>(stamp_ns / 1000) & 0xffff'ffff;
    }
  };
  Message next() {
    const Instant at = kStart + tick++ * period;
    std::exponential_distribution<double> late_s(1 / mean_delay_s);
    const double own = static_cast<double>((at - started).count()) * (1 + drift);
    return {at, started_with_ns + static_cast<std::int64_t>(own),
            at + quickest + from_seconds(late_s(random))};
  }
  void restart() {
    started = kStart + tick * period;
    started_with_ns = 0;
  }
  /// Places a message. @return its error
  Duration place(StampMapper& mapper, const Message& message) const {
    return mapper.place(message.stamp_ns, message.arrived, 0).value() - message.measured - quickest;
  }
};

// Of 200 messages a second the quickest is late by 1/200 of the mean, 15 µs; the worst second of
// 300 by ln(300) times that, 86 µs.
constexpr Duration kPlaced = 100us;

TEST(StampMapper, KeepsTheIntervalBetweenImageAndReading) {
  StampMapper mapper(false);
  Instant now = kStart;
  for (int i = 0; i < 100; ++i, now += 5ms) (void)mapper.place(std::int64_t{i} * 5'000'000, now, 0);
  const auto reading = mapper.place(500'000'000, now, 0);
  const auto image = mapper.place(480'000'000, now + 40ms, 0);  // 20 ms before, came 60 ms after
  ASSERT_TRUE(reading && image);
  EXPECT_EQ(*reading - *image, 20ms);
}

TEST(StampMapper, FollowsDriftWithoutStepsOrReversals) {
  for (const double drift : {50e-6, -50e-6, 5e-3, -5e-3}) {
    DriftingSender sender{drift, 0.003};
    StampMapper mapper(false);
    Instant last{};
    for (int i = 0; i < 60'000; ++i) {
      const auto message = sender.next();
      const Duration error = sender.place(mapper, message);
      const Instant placed = message.measured + sender.quickest + error;
      if (i > 2000) {
        ASSERT_LT(abs(error), kPlaced) << drift << " at " << i * 0.005;
        ASSERT_LE(abs(placed - last - 5000us), 200us);  // the drift, and 2 % of time
      }
      last = placed;
    }
    EXPECT_NEAR(mapper.drift(), drift, drift * drift + 2e-6);
  }
}

TEST(StampMapper, IsNotMovedByAStallOfTheLink) {
  DriftingSender sender{50e-6, 0.001};
  StampMapper mapper(false);
  for (int i = 0; i < 4000; ++i) {
    auto message = sender.next();
    if (i > 2000 && i < 2600) message.arrived += 80ms;  // for three seconds
    const Duration error = sender.place(mapper, message);
    EXPECT_TRUE(i < 1100 || abs(error) < kPlaced) << i << ": " << error.count() << " ns";
  }
}

TEST(StampMapper, IsNotDelayedByFirstMessagesThatAreLate) {
  DriftingSender sender{0, 0.0001};
  StampMapper mapper(false);
  int refused = 0;
  for (int i = 0; i < 40; ++i) {
    auto message = sender.next();
    if (i < 2) message.arrived += 300ms;  // were queued
    if (i < 10)
      refused += mapper.place(message.stamp_ns, message.arrived, 0) ? 0 : 1;
    else
      EXPECT_LT(sender.place(mapper, message), 1ms);
  }
  EXPECT_LE(refused, 5);
}

TEST(StampMapper, IsNotDelayedByMessagesQueuedForSeconds) {
  DriftingSender sender{0, 0.0001};
  StampMapper mapper(false);
  const Instant opened = kStart + 3s;
  for (int i = 0; i < 1000; ++i) {
    auto message = sender.next();
    message.arrived = std::max(message.arrived, opened);  // all at once at first
    if (message.measured < opened + 1s)
      (void)mapper.place(message.stamp_ns, message.arrived, 0);
    else
      EXPECT_LT(abs(sender.place(mapper, message)), 100us);
  }
}

constexpr Duration kKnown = kStart - instant_from_ns(7'000'000'000);  // offset of the sender

TEST(StampMapper, PrefersAKnownClockOffsetToArrivals) {
  DriftingSender sender{0, 0.003, 20ms};
  StampMapper mapper(true);
  for (int i = 0; i < 2000; ++i) {
    const auto message = sender.next();
    EXPECT_EQ(mapper.place_by(kKnown, message.stamp_ns, message.arrived), message.measured);
  }
}

TEST(StampMapper, ChangesToAKnownOffsetWithoutAStep) {
  DriftingSender sender{0, 0.0001, 20ms};
  StampMapper mapper(true);
  Instant last{};
  for (int i = 0; i < 2000; ++i) {
    const auto message = sender.next();
    const auto known = i < 1000 ? std::nullopt : std::optional(kKnown);
    const Instant placed = mapper.place_by(known, message.stamp_ns, message.arrived).value();
    EXPECT_GE(placed - last, 4900us);
    EXPECT_TRUE(i <= 1300 || placed == message.measured) << i;
    last = placed;
  }
}

TEST(StampMapper, RejectsTheOffsetOfAnotherClock) {
  DriftingSender sender{0, 0.0001};
  StampMapper mapper(true);
  int placed = 0;
  for (int i = 0; i < 100; ++i) {
    const auto message = sender.next();
    placed += mapper.place_by(Duration{1h}, message.stamp_ns, message.arrived) ? 1 : 0;
  }
  EXPECT_EQ(placed, 50);
  EXPECT_TRUE(mapper.by_arrival());
}

TEST(StampMapper, IsNotMovedByAStampFarAhead) {
  StampMapper mapper(false);
  Instant now = kStart;
  for (int i = 0; i < 100; ++i, now += 5ms) (void)mapper.place(std::int64_t{i} * 5'000'000, now, 0);
  EXPECT_FALSE(mapper.place(500'000'000 + 3'600'000'000'000, now, 0));
  EXPECT_EQ(mapper.place(500'000'000, now, 0), now);
}

constexpr std::int64_t kMicrosecond_ns = 1000;

/// A microcontroller at 500 Hz.
DriftingSender microcontroller(std::uint64_t counted_us, double drift = 0) {
  DriftingSender device{drift, 0.002, 1ms, 2ms, std::mt19937(11)};
  device.started_with_ns = static_cast<std::int64_t>(counted_us) * kMicrosecond_ns;
  return device;
}

// The quickest message of the first hundreds is late by the mean over their number; a count is a
// microsecond.
constexpr Duration kCounted = 150us;

TEST(DeviceClock, ContinuesWhenTheCounterWraps) {
  auto device = microcontroller(0xffff'ffff - 3'000'000, 50e-6);  // wraps after three seconds
  DeviceClock clock(32, kMicrosecond_ns);
  Instant last{};
  for (int i = 0; i < 10'000; ++i) {
    const auto message = device.next();
    const auto placed = clock.place(message.count(), message.arrived);
    if (i < 1000) continue;
    ASSERT_TRUE(placed) << i;
    EXPECT_LT(abs(*placed - message.measured - 1ms), kCounted);
    EXPECT_GT(*placed, std::exchange(last, *placed));
  }
  EXPECT_EQ(clock.restarts(), 0u);
}

TEST(DeviceClock, FollowsARestartOfTheDevice) {
  // After two seconds, half an hour, and more than half of the counter.
  for (const std::uint64_t counted_us : {0u, 1'800'000'000u, 4'000'000'000u}) {
    auto device = microcontroller(counted_us);
    DeviceClock clock(32, kMicrosecond_ns);
    Instant last{};
    int lost = 0;
    for (int i = 0; i < 3000; ++i) {
      if (i == 1000) device.restart();
      const auto message = device.next();
      const auto placed = clock.place(message.count(), message.arrived);
      if (i >= 1000 && !placed) ++lost;
      if (!placed) continue;
      ASSERT_GT(*placed, std::exchange(last, *placed)) << i;
      if (i <= 1600) continue;
      EXPECT_LT(abs(*placed - message.measured - 1ms), kCounted);
    }
    EXPECT_LE(lost, 60) << counted_us << ": 50 are taken for outliers, some more come too early";
  }
}

TEST(DeviceClock, DropsReadingsOutOfOrder) {
  DeviceClock clock(64, kMicrosecond_ns);
  Instant now = kStart;
  for (std::uint64_t i = 1; i < 1000; ++i, now += 2ms) {
    EXPECT_TRUE(clock.place(i * 2000, now));
    EXPECT_FALSE(i % 100 == 0 && clock.place(i * 2000 - 2000, now)) << "again, and older";
  }
  EXPECT_EQ(clock.dropped(), 9u);
  EXPECT_EQ(clock.restarts(), 0u);
}

TEST(DeviceClock, ToleratesAnyCount) {
  DeviceClock clock(64, kMicrosecond_ns);
  Instant now = kStart;
  std::mt19937_64 random(1);
  std::optional<Instant> last;
  for (int i = 0; i < 10'000; ++i, now += 1ms) {
    const auto placed = clock.place(random(), now, Duration{static_cast<std::int64_t>(random())});
    EXPECT_TRUE(!placed || !last || *placed > *last);
    if (placed) last = placed;
  }
  EXPECT_FALSE(clock.place(std::numeric_limits<std::uint64_t>::max(), now));
}

}  // namespace
}  // namespace fiducap
