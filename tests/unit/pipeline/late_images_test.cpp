#include "pipeline/late_images.hpp"

#include <gmock/gmock.h>

namespace fiducap {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(50);
constexpr Duration kBehind = std::chrono::milliseconds(540);

/// @return images after which the camera is only watched; 0: it is not
int watched_after(LateImages& late, int images, int dropped_of_ten) {
  Instant stamp{};
  for (int i = 1; i <= images; ++i) {
    stamp += kPeriod;
    if (late.note(0, stamp, i % 10 < dropped_of_ten, stamp + kBehind)) return i;
  }
  return 0;
}

TEST(LateImages, OnlyACameraOfWhichAllAreLateForLongIsWatchedAndThatIsSaidOnce) {
  LateImages late(2);
  EXPECT_TRUE(late.take_news(0).empty());
  EXPECT_EQ(watched_after(late, 200, 9), 0) << "a computer that does not keep up";
  late = LateImages(2);
  EXPECT_EQ(watched_after(late, 200, 10), 50);
  EXPECT_TRUE(late.only_watches(0));
  EXPECT_FALSE(late.only_watches(1));
  EXPECT_THAT(late.take_news(0), testing::HasSubstr("stamped 0.54 s before"));
  EXPECT_TRUE(late.take_news(0).empty());
  EXPECT_TRUE(late.take_news(1).empty());
}

}  // namespace
}  // namespace fiducap
