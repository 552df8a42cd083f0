// Frames from their parts to the reader.
#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <thread>
#include <vector>

#include "src/frame_assembler.hpp"
#include "src/latest_frame.hpp"
#include "src/receive_statistics.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap::sdk {
namespace {

using testing::IsNull;
using testing::NotNull;

constexpr std::uint64_t kSession = 9;
constexpr std::uint32_t kBodies = 5;  // two parts: 3 + 2

class FrameAssemblerTest : public testing::Test {
 protected:
  FrameAssemblerTest() {
    assembler_.begin(kSession);
    add_model(1);
  }
  static PartPlace place(std::uint32_t index) { return {index, 2, index * 3, kBodies}; }
  void add_model_part(std::uint64_t generation, std::uint32_t index) {
    ModelPart part{kSession, generation, 0, place(index), {}};
    for (std::uint32_t i = index * 3; i < (index == 0 ? 3 : kBodies); ++i)
      part.bodies.emplace_back(static_cast<int>(i) + 1,
                               "body" + std::to_string(i) + "g" + std::to_string(generation));
    assembler_.add(part);
  }
  void add_model(std::uint64_t generation) {
    add_model_part(generation, 0);
    add_model_part(generation, 1);
  }
  static FramePart part(std::uint64_t number, std::uint32_t index, std::uint64_t generation = 1) {
    FramePart made;
    made.session = kSession;
    made.model_generation = generation;
    made.place = place(index);
    made.frame.number = number;
    for (std::uint32_t i = index * 3; i < (index == 0 ? 3 : kBodies); ++i) {
      Body body;
      body.id = static_cast<int>(i) + 1;
      body.position_m[0] = static_cast<double>(number);
      made.frame.bodies.push_back(body);
    }
    return made;
  }
  Frame* add(std::uint64_t number, std::uint32_t index, std::uint64_t generation = 1) {
    return assembler_.add(part(number, index, generation));
  }
  /// Both parts.
  Frame* add_frame(std::uint64_t number, std::uint64_t generation = 1) {
    EXPECT_THAT(add(number, 0, generation), IsNull());
    return add(number, 1, generation);
  }

  FrameAssembler assembler_;
};

TEST_F(FrameAssemblerTest, JoinsPartsInAnyOrder) {
  EXPECT_THAT(add(1, 1), IsNull());
  EXPECT_THAT(add(2, 0), IsNull());
  ASSERT_THAT(add(1, 0), NotNull());
  Frame* frame = add(2, 1);
  ASSERT_THAT(frame, NotNull());
  for (const Body& body : frame->bodies) EXPECT_EQ(body.position_m[0], 2.0);
  EXPECT_EQ(assembler_.lost(), 0u);
  frame = add_frame(3);
  ASSERT_THAT(frame, NotNull());
  ASSERT_EQ(frame->bodies.size(), kBodies);
  EXPECT_EQ(frame->bodies[0].name, "body0g1");
  EXPECT_EQ(frame->bodies[4].name, "body4g1");
}

TEST_F(FrameAssemblerTest, IgnoresDuplicatesAndFramesOlderThanACompleteOne) {
  EXPECT_THAT(add(1, 0), IsNull());
  EXPECT_THAT(add_frame(1), NotNull());
  EXPECT_THAT(add(1, 1), IsNull()) << "the frame is complete";
  EXPECT_THAT(add_frame(3), NotNull());
  EXPECT_THAT(add_frame(2), IsNull());
}

TEST_F(FrameAssemblerTest, CountsIncompleteAndMissingFrames) {
  add_frame(1);
  for (std::uint64_t number = 2; number <= 10; ++number) EXPECT_THAT(add(number, 0), IsNull());
  EXPECT_THAT(add_frame(11), NotNull());
  EXPECT_EQ(assembler_.lost(), 9u);
  EXPECT_THAT(add_frame(53), NotNull());
  EXPECT_EQ(assembler_.lost(), 9u + 41u);
  EXPECT_EQ(assembler_.received(), 3u);
}

TEST_F(FrameAssemblerTest, IgnoresOtherSessions) {
  FramePart other = part(1, 0);
  other.session = kSession + 1;
  EXPECT_THAT(assembler_.add(other), IsNull());
  EXPECT_THAT(add(1, 1), IsNull());
  EXPECT_THAT(add(1, 0), NotNull());
}

TEST_F(FrameAssemblerTest, WaitsForTheModelOfAFrame) {
  EXPECT_THAT(add_frame(1, 2), IsNull());
  add_model_part(2, 0);
  EXPECT_THAT(add_frame(2, 2), IsNull()) << "half of the model is missing";
  add_model_part(2, 1);
  EXPECT_EQ(assembler_.model_generation(), 2u);
  const Frame* frame = add_frame(3, 2);
  ASSERT_THAT(frame, NotNull());
  EXPECT_EQ(frame->bodies[3].name, "body3g2");
}

TEST_F(FrameAssemblerTest, RefusesBodiesThatAreNotInTheModel) {
  FramePart wrong = part(1, 0);
  wrong.frame.bodies[1].id = 77;
  EXPECT_THAT(assembler_.add(wrong), IsNull());
  EXPECT_THAT(add(1, 1), IsNull());
}

TEST_F(FrameAssemblerTest, FrameNeverHasPosesOfAnEarlierOne) {
  ASSERT_THAT(add_frame(1), NotNull());
  for (std::uint64_t number = 2; number < 5; ++number) {
    FramePart twice = part(number, 0);  // as the second part, with the bodies of the first
    twice.place = {1, 2, 0, kBodies};
    twice.frame.bodies.resize(2);
    add(number, 0);
    EXPECT_THAT(assembler_.add(twice), IsNull());
  }
}

TEST_F(FrameAssemblerTest, StartsAgainWithNewSession) {
  EXPECT_THAT(add_frame(100), NotNull());
  assembler_.begin(kSession);
  EXPECT_EQ(assembler_.model_generation(), 0u);
  add_model(1);
  EXPECT_THAT(add_frame(1), NotNull());
  EXPECT_EQ(assembler_.lost(), 0u);
}

TEST_F(FrameAssemblerTest, EmptySceneIsAFrame) {
  assembler_.begin(kSession);
  assembler_.add(ModelPart{kSession, 1, 0, {0, 1, 0, 0}, {}});
  FramePart empty = part(1, 0);
  empty.place = {0, 1, 0, 0};
  empty.frame.bodies.clear();
  EXPECT_THAT(assembler_.add(empty), NotNull());
}

TEST_F(FrameAssemblerTest, AllocatesNothingAfterWarmUp) {
  FramePart first = part(0, 0);
  FramePart second = part(0, 1);
  const auto run = [&](std::uint64_t from, std::uint64_t to) {
    for (std::uint64_t number = from; number < to; ++number) {
      first.frame.number = second.frame.number = number;
      EXPECT_EQ(assembler_.add(first), nullptr);
      EXPECT_NE(assembler_.add(second), nullptr);
    }
  };
  run(1, 10);
  const AllocationCounter allocations;
  run(10, 100);
  EXPECT_EQ(allocations.count(), 0u);
}

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
