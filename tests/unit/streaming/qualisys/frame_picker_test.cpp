#include "streaming/qualisys/connection.hpp"

#include <gtest/gtest.h>

namespace fiducap::qualisys {
namespace {

/// How many of the frames of `seconds` at 100 Hz are taken, the first one at a time that is not
/// round.
int taken(Rate rate, int seconds, std::int64_t jitter_ns = 0) {
  FramePicker picker(rate);
  SceneFrame frame;
  frame.rate_hz = 100;
  int count = 0;
  for (int i = 0; i < 100 * seconds; ++i) {
    frame.number = static_cast<std::uint64_t>(i) + 41;
    frame.at = instant_from_ns(1'234'567'891 + i * 10'000'000LL + (i % 3 - 1) * jitter_ns);
    if (picker.wants(frame)) ++count;
  }
  return count;
}

TEST(QualisysFramePicker, AllFramesAreAll) { EXPECT_EQ(taken({}, 2), 200); }

TEST(QualisysFramePicker, ADivisorTakesEveryNthFromTheFirst) {
  EXPECT_EQ(taken({RateKind::kFrequencyDivisor, 4}, 2), 50);
  EXPECT_EQ(taken({RateKind::kFrequencyDivisor, 1000}, 2), 1);
}

TEST(QualisysFramePicker, AFrequencyIsMetOverTime) {
  constexpr int kEnds = 1;  // the first frame is always taken
  for (const std::uint32_t hz : {1U, 7U, 30U, 50U, 60U, 99U, 100U}) {
    for (const std::int64_t jitter_ns : {0, 300'000}) {
      EXPECT_NEAR(taken({RateKind::kFrequency, hz}, 10, jitter_ns), 10 * static_cast<int>(hz),
                  kEnds)
          << hz << " Hz";
    }
  }
}

TEST(QualisysFramePicker, AFrequencyAboveTheFramesRateIsAllFrames) {
  EXPECT_EQ(taken({RateKind::kFrequency, 1000}, 2), 200);
}

TEST(QualisysFramePicker, DoesNotCatchUpAfterAPause) {
  FramePicker picker({RateKind::kFrequency, 10});
  SceneFrame frame;
  frame.rate_hz = 100;
  EXPECT_TRUE(picker.wants(frame));
  frame.at = frame.at + std::chrono::seconds(60);
  int count = 0;
  for (int i = 0; i < 100; ++i) {
    count += picker.wants(frame) ? 1 : 0;
    frame.at = frame.at + std::chrono::milliseconds(10);
  }
  EXPECT_EQ(count, 10);
}

}  // namespace
}  // namespace fiducap::qualisys
