#include "src/latest_frame.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <thread>
#include <vector>

#include "src/receive_statistics.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap::sdk {
namespace {

/// Every position is the frame's number.
void fill(Frame& frame, std::uint64_t number, std::size_t bodies) {
  frame.number = number;
  frame.bodies.resize(bodies);
  for (Body& body : frame.bodies) {
    body.name = "a name that is too long for the small string";
    body.position_m.fill(static_cast<double>(number));
  }
}

class LatestFrameTest : public testing::Test {
 protected:
  bool publish(std::uint64_t n, std::size_t bodies = 3) {
    Frame frame;
    fill(frame, n, bodies);
    return latest_.publish(frame) != nullptr;
  }
  LatestFrame latest_;
};

TEST_F(LatestFrameTest, IsTheNewest) {
  EXPECT_FALSE(latest_.read([](const Frame&) { FAIL() << "there is no frame"; }));
  for (std::uint64_t n = 1; n < 50; ++n) {
    ASSERT_TRUE(publish(n));
    std::uint64_t read = 0;
    EXPECT_TRUE(latest_.read([&](const Frame& newest) { read = newest.number; }));
    EXPECT_EQ(read, n);
  }
}

TEST_F(LatestFrameTest, FrameIsKeptWhileItIsRead) {
  publish(1);
  latest_.read([&](const Frame& held) {
    for (std::uint64_t n = 2; n < 50; ++n) ASSERT_TRUE(publish(n));
    EXPECT_EQ(held.number, 1u);
    EXPECT_EQ(held.bodies[2].position_m[1], 1.0);
  });
}

TEST_F(LatestFrameTest, FrameIsSkippedOnlyWhenAllPlacesAreRead) {
  std::uint64_t published = 0;
  const std::function<void()> nest = [&] {
    if (!publish(published + 1)) return;
    ++published;
    latest_.read([&](const Frame& held) {
      const std::uint64_t n = held.number;
      nest();
      EXPECT_EQ(held.number, n);
    });
  };
  nest();
  EXPECT_EQ(published, 8u);
  EXPECT_TRUE(publish(100)) << "all readers have left";
}

TEST_F(LatestFrameTest, ReadingAllocatesNothingOnceTheFrameHasRoom) {
  for (std::uint64_t n = 1; n < 20; ++n) publish(n, 100);
  Frame copy;
  latest_.read([&](const Frame& newest) { copy = newest; });
  const AllocationCounter allocations;
  for (int i = 0; i < 100; ++i) latest_.read([&](const Frame& newest) { copy = newest; });
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(copy.number, 19u);
}

TEST_F(LatestFrameTest, ThreadsReadWholeFramesInOrder) {
  std::atomic<bool> done{false};
  std::atomic<int> torn{0}, reads{0};
  std::vector<std::jthread> readers;
  for (int i = 0; i < 3; ++i) {
    readers.emplace_back([&] {
      Frame copy;
      std::uint64_t last = 0;
      while (!done.load()) {
        if (!latest_.read([&](const Frame& newest) { copy = newest; })) continue;
        bool whole = copy.number >= last;
        for (const Body& body : copy.bodies)
          for (const double x : body.position_m)
            whole = whole && x == static_cast<double>(copy.number);
        torn += whole ? 0 : 1;
        ++reads;
        last = copy.number;
      }
    });
  }
  Frame frame;
  std::uint64_t published = 0;
  std::uint64_t n = 0;
  while (reads.load() < 3000) {
    fill(frame, ++n, 20);
    published += latest_.publish(frame) != nullptr ? 1 : 0;
  }
  done.store(true);
  readers.clear();
  EXPECT_EQ(torn.load(), 0);
  EXPECT_EQ(published, n) << "three readers do not hold seven places";
}

TEST(ReceiveStatistics, RateIsOfTheLastSecond) {
  ReceiveStatistics statistics;
  EXPECT_EQ(statistics.rate_hz(kSecond), 0.0);
  Nanoseconds now = 100 * kSecond;
  for (int i = 0; i < 300; ++i) statistics.add(now += 10 * kMillisecond, 0.001);
  EXPECT_EQ(statistics.rate_hz(now), 100.0);
  EXPECT_EQ(statistics.rate_hz(now + kSecond / 2), 50.0);
  EXPECT_EQ(statistics.rate_hz(now + 2 * kSecond), 0.0);
}

TEST(ReceiveStatistics, MeasuresRatesAboveItsMemory) {
  ReceiveStatistics statistics;
  Nanoseconds now = 100 * kSecond;
  for (int i = 0; i < 5000; ++i) statistics.add(now += kMillisecond / 4, 0.001);
  constexpr double kOneFrame_hz = 5.0;  // the edge of the window cuts one frame of a thousand
  EXPECT_NEAR(statistics.rate_hz(now), 4000.0, kOneFrame_hz);
}

TEST(ReceiveStatistics, QuantilesAreOfTheLastThousand) {
  ReceiveStatistics statistics;
  for (int i = 0; i < 500; ++i) statistics.add(i, 7.0);
  for (int i = 1; i <= 1000; ++i) statistics.add(i, i * 1e-3);
  EXPECT_DOUBLE_EQ(statistics.latency_quantile_s(0.50), 0.500);
  EXPECT_DOUBLE_EQ(statistics.latency_quantile_s(0.99), 0.990);
  EXPECT_DOUBLE_EQ(statistics.latency_quantile_s(1.0), 1.0);
}

TEST(ReceiveStatistics, OmitsFramesWithoutACommonClock) {
  ReceiveStatistics statistics;
  EXPECT_TRUE(std::isnan(statistics.latency_quantile_s(0.5)));
  statistics.add(1, std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(std::isnan(statistics.latency_quantile_s(0.5)));
  statistics.add(2, 0.25);
  EXPECT_EQ(statistics.latency_quantile_s(0.5), 0.25);
}

}  // namespace
}  // namespace fiducap::sdk
