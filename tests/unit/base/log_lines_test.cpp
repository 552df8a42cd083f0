#include "base/log_lines.hpp"

#include <gmock/gmock.h>

namespace fiducap::log {
namespace {

using namespace std::chrono_literals;
constexpr LineLimiter::Time kStart{};

TEST(LineLimiter, DropsAFloodAndReportsTheCountOnce) {
  LineLimiter limiter;
  int allowed = 0;
  for (int i = 0; i < 1000; ++i)
    allowed += limiter.allow({"natnet"}, Level::kWarning, kStart) ? 1 : 0;
  EXPECT_EQ(allowed, static_cast<int>(LineLimiter::kMost));
  EXPECT_TRUE(limiter.allow({"natnet"}, Level::kError, kStart)) << "a flood hides no error";
  EXPECT_TRUE(limiter.allow({"vrpn"}, Level::kWarning, kStart));

  EXPECT_THAT(limiter.ended(kStart + 9s), testing::IsEmpty());
  const auto ended = limiter.ended(kStart + LineLimiter::kWindow);
  ASSERT_EQ(ended.size(), 1U);
  EXPECT_EQ(ended[0].source.module, "natnet");
  EXPECT_EQ(ended[0].lines, 1000 - LineLimiter::kMost);
  EXPECT_THAT(limiter.ended(kStart + 30s), testing::IsEmpty());
  EXPECT_TRUE(limiter.allow({"natnet"}, Level::kWarning, kStart + LineLimiter::kWindow));
}

TEST(LineLimiter, FloodAboutOneBodyHidesNoOther) {
  LineLimiter limiter;
  for (int i = 0; i < 1000; ++i) (void)limiter.allow({"event", "drone"}, Level::kWarning, kStart);
  EXPECT_TRUE(limiter.allow({"event", "rover"}, Level::kWarning, kStart));
  const auto ended = limiter.ended(kStart + LineLimiter::kWindow);
  ASSERT_EQ(ended.size(), 1U);
  EXPECT_EQ(ended[0].source.subject, "drone");
}

TEST(LineLimiter, RemovesWindowsOfSilentSources) {
  LineLimiter limiter;
  for (int i = 0; i < 1000; ++i)
    (void)limiter.allow({"event", std::to_string(i)}, Level::kWarning, kStart);
  EXPECT_EQ(limiter.remembered(), 1000U);
  EXPECT_THAT(limiter.ended(kStart + LineLimiter::kWindow), testing::IsEmpty());
  EXPECT_EQ(limiter.remembered(), 0U);
}

TEST(LineLimiter, KeepsAllLinesOfASlowModule) {
  LineLimiter limiter;
  for (int i = 0; i < 1000; ++i)
    ASSERT_TRUE(limiter.allow({"mapping"}, Level::kInfo, kStart + i * 250ms)) << i;
}

TEST(LineQueue, KeepsTheFirstLinesAndCountsOthers) {
  LineQueue queue;
  for (std::uint64_t i = 1; i <= LineQueue::kMost + 7; ++i) queue.push({.number = i});
  EXPECT_EQ(queue.take_dropped(), 7U);
  EXPECT_EQ(queue.take_dropped(), 0U);
  for (std::uint64_t i = 1; i <= LineQueue::kMost; ++i) ASSERT_EQ(queue.pop().number, i);
  EXPECT_TRUE(queue.empty());
}

}  // namespace
}  // namespace fiducap::log
