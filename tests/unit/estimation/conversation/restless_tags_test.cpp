#include "estimation/conversation/restless_tags.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

Instant at_s(int seconds) { return Instant{std::chrono::seconds(seconds)}; }

TEST(RestlessTags, ATagThatWasMovedOnceMayComeBackAtOnce) {
  RestlessTags restless;
  restless.note_given_up(7, at_s(10));
  EXPECT_FALSE(restless.is_barred(7, at_s(10)));
}

TEST(RestlessTags, OneThatMovesAgainStaysAwayForLongerEachTime) {
  RestlessTags restless;
  restless.note_given_up(7, at_s(10));
  restless.note_given_up(7, at_s(20));
  EXPECT_TRUE(restless.is_barred(7, at_s(39)));
  EXPECT_FALSE(restless.is_barred(7, at_s(41)));
  restless.note_given_up(7, at_s(50));
  EXPECT_TRUE(restless.is_barred(7, at_s(89)));
  EXPECT_FALSE(restless.is_barred(7, at_s(91)));
  EXPECT_FALSE(restless.is_barred(8, at_s(51))) << "another tag";
}

TEST(RestlessTags, AreForgivenAfterHalfAnHour) {
  RestlessTags restless;
  restless.note_given_up(7, at_s(10));
  restless.note_given_up(7, at_s(10 + 31 * 60));
  EXPECT_FALSE(restless.is_barred(7, at_s(11 + 31 * 60)));
}

TEST(RestlessTags, RememberTheNewestOfManyIds) {
  RestlessTags restless;
  for (int id = 0; id < 1000; ++id) {
    restless.note_given_up(id, at_s(1));
    restless.note_given_up(id, at_s(2));
  }
  EXPECT_FALSE(restless.is_barred(0, at_s(3)));
  EXPECT_TRUE(restless.is_barred(999, at_s(3)));
}

}  // namespace
}  // namespace fiducap
