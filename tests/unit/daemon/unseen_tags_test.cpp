#include "daemon/bodies/unseen_tags.hpp"

#include <gtest/gtest.h>

#include "support/fake_clock.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

/// A body with ten images per second.
class UnseenTagsTest : public testing::Test {
 protected:
  UnseenTagsTest() { second_looks_.add(unseen_); }
  void see(Duration during, bool has_tags) {
    for (const Instant end = at_ + during; at_ < end; at_ += 100ms)
      unseen_.note(image_, at_, has_tags);
    second_looks_.look({});
  }

  SharedImage image_{std::make_shared<const GrayImage>()};
  Instant at_{instant_from_ns(1'000'000'000)};
  int looks_{0};
  FakeClock clock_;
  UnseenTags unseen_;
  SecondLooks second_looks_{[this](std::span<const SharedImage> images, const std::stop_token&) {
                              EXPECT_EQ(images.size(), UnseenTags::kEnough);
                              ++looks_;
                              return std::string("the images are mirrored");
                            },
                            clock_};
};

TEST_F(UnseenTagsTest, AreLookedForAgainOnceThenEveryMinute) {
  see(3s, false);
  EXPECT_EQ(looks_, 0) << "not for long enough";
  see(2s, false);
  EXPECT_EQ(looks_, 1);
  EXPECT_EQ(unseen_.why(), "the images are mirrored");
  see(30s, false);
  EXPECT_EQ(looks_, 1);
  see(40s, false);
  EXPECT_EQ(looks_, 2);
}

TEST_F(UnseenTagsTest, HaveNoReasonOnceTheyAreSeen) {
  see(6s, false);
  EXPECT_NE(unseen_.why(), "");
  see(1s, true);
  EXPECT_EQ(unseen_.why(), "");
  unseen_.answer("too late");
  EXPECT_EQ(unseen_.why(), "");
  see(4s, false);
  EXPECT_EQ(looks_, 1) << "counted from the last tag";
}

TEST_F(UnseenTagsTest, OfCornersAreNotLookedFor) {
  image_ = nullptr;
  see(20s, false);
  EXPECT_EQ(looks_, 0);
}

}  // namespace
}  // namespace fiducap
