#include "src/latest_frame.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "support/allocation_counter.hpp"

namespace fiducap::sdk {
namespace {

Frame frame_of(std::uint64_t number, std::size_t bodies = 3) {
  Frame frame;
  frame.number = number;
  for (std::size_t i = 0; i < bodies; ++i) {
    Body body;
    body.name = "a name that is too long for the small string";
    body.position_m.fill(static_cast<double>(number));
    frame.bodies.push_back(body);
  }
  return frame;
}

TEST(LatestFrame, HasNothingBeforeTheFirst) {
  const LatestFrame latest;
  EXPECT_FALSE(latest.read([](const Frame&) { FAIL() << "there is no frame"; }));
}

TEST(LatestFrame, GivesTheNewest) {
  LatestFrame latest;
  for (std::uint64_t number = 1; number < 50; ++number) {
    Frame frame = frame_of(number);
    ASSERT_NE(latest.publish(frame), nullptr);
    std::uint64_t read = 0;
    EXPECT_TRUE(latest.read([&](const Frame& newest) { read = newest.number; }));
    EXPECT_EQ(read, number);
  }
}

TEST(LatestFrame, KeepsAFrameWhileItIsRead) {
  LatestFrame latest;
  Frame frame = frame_of(1);
  latest.publish(frame);
  latest.read([&](const Frame& held) {
    for (std::uint64_t number = 2; number < 50; ++number) {
      Frame next = frame_of(number);
      ASSERT_NE(latest.publish(next), nullptr);
    }
    EXPECT_EQ(held.number, 1u);
    EXPECT_EQ(held.bodies[2].position_m[1], 1.0);
  });
}

TEST(LatestFrame, SkipsAFrameOnlyWhenReadersStandInEveryPlace) {
  LatestFrame latest;
  std::uint64_t published = 0;
  const std::function<void()> nest = [&] {
    Frame next = frame_of(published + 1);
    if (latest.publish(next) == nullptr) return;
    ++published;
    latest.read([&](const Frame& held) {
      const std::uint64_t number = held.number;
      nest();
      EXPECT_EQ(held.number, number);
    });
  };
  nest();
  EXPECT_EQ(published, 8u);
  Frame next = frame_of(100);
  EXPECT_NE(latest.publish(next), nullptr) << "all readers have left";
}

TEST(LatestFrame, ReadingAllocatesNothingOnceTheFrameHasRoom) {
  LatestFrame latest;
  Frame copy;
  for (std::uint64_t number = 1; number < 20; ++number) {
    Frame frame = frame_of(number, 100);
    latest.publish(frame);
  }
  latest.read([&](const Frame& newest) { copy = newest; });
  const AllocationCounter allocations;
  for (int i = 0; i < 100; ++i) latest.read([&](const Frame& newest) { copy = newest; });
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(copy.number, 19u);
}

TEST(LatestFrame, ReadersNeverSeeHalfAFrameOrAnOlderOne) {
  LatestFrame latest;
  std::atomic<bool> done{false};
  std::atomic<int> torn{0};
  std::atomic<int> reads{0};
  std::vector<std::thread> readers;
  for (int i = 0; i < 3; ++i) {
    readers.emplace_back([&] {
      Frame copy;
      std::uint64_t last = 0;
      while (!done.load()) {
        if (!latest.read([&](const Frame& newest) { copy = newest; })) continue;
        bool whole = copy.number >= last;
        for (const Body& body : copy.bodies) {
          for (const double x : body.position_m)
            whole = whole && x == static_cast<double>(copy.number);
        }
        torn += whole ? 0 : 1;
        ++reads;
        last = copy.number;
      }
    });
  }
  Frame frame = frame_of(1, 20);
  std::uint64_t published = 0;
  std::uint64_t number = 0;
  while (reads.load() < 3000) {
    ++number;
    frame.number = number;
    frame.bodies.resize(20);
    for (Body& body : frame.bodies) body.position_m.fill(static_cast<double>(number));
    published += latest.publish(frame) != nullptr ? 1 : 0;
  }
  done.store(true);
  for (auto& reader : readers) reader.join();
  EXPECT_EQ(torn.load(), 0);
  EXPECT_EQ(published, number) << "three readers cannot stand in seven places";
}

}  // namespace
}  // namespace fiducap::sdk
