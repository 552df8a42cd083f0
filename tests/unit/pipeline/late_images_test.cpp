#include "pipeline/pose_trust.hpp"

#include <gmock/gmock.h>

namespace fiducap {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(50);
constexpr Duration kBehind = std::chrono::milliseconds(540);

/// A stream of images. @return those after which `wanted` happens; 0: it does not
int images_until(LateImages::Change wanted, LateImages& late, Instant& stamp, Duration behind,
                 int images, int dropped_of_ten) {
  for (int i = 1; i <= images; ++i) {
    stamp += kPeriod;
    if (late.note(0, stamp, i % 10 < dropped_of_ten, stamp + behind) == wanted) return i;
  }
  return 0;
}

int watched_after(LateImages& late, int images, int dropped_of_ten) {
  Instant stamp{};
  return images_until(LateImages::Change::kExcluded, late, stamp, kBehind, images, dropped_of_ten);
}

TEST(LateImages, OnlyACameraOfWhichAllAreLateForLongIsWatchedAndThatIsSaidOnce) {
  LateImages late(2);
  EXPECT_TRUE(late.take_report(0).empty());
  EXPECT_EQ(watched_after(late, 200, 9), 0) << "a computer that does not keep up";
  late = LateImages(2);
  EXPECT_EQ(watched_after(late, 200, 10), 50);
  EXPECT_TRUE(late.excludes(0, {}));
  EXPECT_FALSE(late.excludes(1, Instant{} + kPeriod));
  EXPECT_THAT(late.take_report(0), testing::HasSubstr("stamped 0.54 s before"));
  EXPECT_TRUE(late.take_report(0).empty());
  EXPECT_TRUE(late.take_report(1).empty());
}

TEST(LateImages, AreUsedAgainAfterTheyCameInTimeForAsLong) {
  LateImages late(1);
  Instant stamp{};
  using Change = LateImages::Change;
  ASSERT_NE(images_until(Change::kExcluded, late, stamp, kBehind, 100, 10), 0);
  EXPECT_FALSE(late.take_report(0).empty());
  EXPECT_EQ(images_until(Change::kInTime, late, stamp, kBehind, 200, 0), 0) << "still late";
  EXPECT_EQ(images_until(Change::kInTime, late, stamp, kPeriod, 200, 0), 50);
  EXPECT_FALSE(late.excludes_any());
  EXPECT_TRUE(late.excludes(0, stamp)) << "was on its way, placed by the wrong clock";
  EXPECT_FALSE(late.excludes(0, stamp + kPeriod));
  ASSERT_NE(images_until(Change::kExcluded, late, stamp, kBehind, 100, 10), 0);
  EXPECT_FALSE(late.take_report(0).empty()) << "told anew";
}

}  // namespace
}  // namespace fiducap
