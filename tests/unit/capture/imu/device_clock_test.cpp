#include "capture/stamp_mapper.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <random>

namespace fiducap {
namespace {

using namespace std::chrono_literals;

constexpr Instant kStart = instant_from_ns(500'000'000'000);
constexpr std::int64_t kMicrosecond_ns = 1000;

/// A microcontroller at 500 Hz that counts microseconds in 32 bits, on a line that delays.
class Microcontroller final {
 public:
  explicit Microcontroller(std::uint64_t counted, double drift = 0)
      : counted_(counted), drift_(drift) {}

  void reboot() {
    booted_at_ = now_;
    counted_ = 0;
  }
  void step() { now_ += 2ms; }
  [[nodiscard]] Instant now() const { return now_; }
  [[nodiscard]] std::uint64_t count() const {
    const double since_us = to_seconds(now_ - booted_at_) * 1e6 * (1 + drift_);
    return (counted_ + static_cast<std::uint64_t>(since_us)) & 0xffff'ffff;
  }
  Instant arrival() { return now_ + 1ms + from_seconds(late_s_(random_)); }

 private:
  std::uint64_t counted_;
  double drift_;
  Instant now_{kStart};
  Instant booted_at_{kStart};
  std::mt19937 random_{11};
  std::exponential_distribution<double> late_s_{1 / 0.002};
};

// The quickest of the first hundreds of messages is late by the mean over their number; a count is
// a microsecond.
constexpr Duration kPlaced = 150us;

TEST(DeviceClock, GoesOnWhenTheCounterWraps) {
  Microcontroller device(0xffff'ffff - 3'000'000, 50e-6);  // wraps after three seconds
  DeviceClock clock(32, kMicrosecond_ns);
  std::optional<Instant> last;
  for (int i = 0; i < 10'000; ++i, device.step()) {
    const auto placed = clock.place(device.count(), device.arrival());
    if (i < 1000) continue;
    ASSERT_TRUE(placed) << i;
    EXPECT_LT(*placed - device.now() - 1ms, kPlaced);
    EXPECT_GT(*placed - device.now() - 1ms, -kPlaced);
    if (last) {
      EXPECT_GT(*placed, *last);
    }
    last = placed;
  }
  EXPECT_EQ(clock.restarts(), 0u);
}

TEST(DeviceClock, ADeviceThatStartsAgainIsPlacedAtOnce) {
  // After two seconds; after half an hour; after so long that half the counter lies between.
  for (const std::uint64_t counted_us : {0u, 1'800'000'000u, 4'000'000'000u}) {
    Microcontroller device(counted_us);
    DeviceClock clock(32, kMicrosecond_ns);
    std::optional<Instant> last;
    int lost = 0;
    for (int i = 0; i < 3000; ++i, device.step()) {
      if (i == 1000) device.reboot();
      const auto placed = clock.place(device.count(), device.arrival());
      if (i >= 1000 && !placed) ++lost;
      if (!placed) continue;
      if (last) {
        ASSERT_GT(*placed, *last) << i;
      }
      if (i > 1600) {
        EXPECT_LT(*placed - device.now() - 1ms, kPlaced);
        EXPECT_GT(*placed - device.now() - 1ms, -kPlaced);
      }
      last = placed;
    }
    EXPECT_LE(lost, 60) << counted_us << ": 50 are taken for outliers, some more come too early";
  }
}

TEST(DeviceClock, ReadingsThatOvertookEachOtherAreDropped) {
  DeviceClock clock(64, kMicrosecond_ns);
  Instant now = kStart;
  for (std::uint64_t i = 1; i < 1000; ++i, now += 2ms) {
    EXPECT_TRUE(clock.place(i * 2000, now));
    if (i % 100 == 0) {
      EXPECT_FALSE(clock.place(i * 2000 - 2000, now)) << "again, and older";
    }
  }
  EXPECT_EQ(clock.dropped(), 9u);
  EXPECT_EQ(clock.restarts(), 0u);
}

TEST(DeviceClock, AnyCountIsSurvived) {
  DeviceClock clock(64, kMicrosecond_ns);
  Instant now = kStart;
  std::mt19937_64 random(1);
  std::optional<Instant> last;
  for (int i = 0; i < 10'000; ++i, now += 1ms) {
    const auto placed = clock.place(random(), now, Duration{static_cast<std::int64_t>(random())});
    if (placed && last) {
      EXPECT_GT(*placed, *last);
    }
    if (placed) last = placed;
  }
  EXPECT_FALSE(clock.place(std::numeric_limits<std::uint64_t>::max(), now));
}

}  // namespace
}  // namespace fiducap
