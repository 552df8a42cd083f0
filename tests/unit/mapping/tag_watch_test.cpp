#include "mapping/moved_tags.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

class TagWatchTest : public testing::Test {
 protected:
  static Instant at(int second) { return instant_from_ns(second * 1'000'000'000LL); }

  std::vector<TagDisplacement> report(int body_id, int second, const std::vector<int>& fitting,
                                      const std::vector<int>& contradicted = {}) {
    return watch_.report(body_id, at(second), fitting, contradicted);
  }

  TagWatch watch_;
};

TEST_F(TagWatchTest, ThreeWordsOfABodyThatFindsOtherTagsInPlaceDecide) {
  EXPECT_THAT(report(1, 1, {2, 3, 7}), IsEmpty());
  EXPECT_THAT(report(1, 4, {2, 3}, {7}), IsEmpty());
  EXPECT_THAT(report(1, 4, {2, 3}, {7}), IsEmpty()) << "two are too few";
  const auto gone = report(1, 5, {2, 3}, {7});
  ASSERT_EQ(gone.size(), 1U);
  EXPECT_EQ(gone[0].tag_id, 7);
  EXPECT_EQ(gone[0].fitted_at, at(1));
  EXPECT_EQ(gone[0].first_report_at, at(4));
  EXPECT_EQ(gone[0].at, at(5));
  EXPECT_THAT(gone[0].by, ElementsAre(1));
  EXPECT_THAT(report(1, 6, {2, 3}, {7}), IsEmpty()) << "it is asked about anew";
}

TEST_F(TagWatchTest, TwoBodiesDecideTogether) {
  for (int i = 0; i < 2; ++i) (void)report(1, 1, {2, 3}, {7});
  const auto gone = report(2, 200, {4, 5}, {7});
  ASSERT_EQ(gone.size(), 1U);
  EXPECT_EQ(gone[0].fitted_at, std::nullopt);
  EXPECT_THAT(gone[0].by, ElementsAre(1, 2));
}

TEST_F(TagWatchTest, ABodyThatContradictsOneTagAfterTheOtherIsNotBelieved) {
  (void)report(1, 1, {2, 3});
  EXPECT_THAT(report(1, 2, {2, 3, 4, 5, 6}, {7}), IsEmpty());
  for (int i = 0; i < 9; ++i) EXPECT_THAT(report(1, 3, {2, 3, 4, 5, 6}, {8}), IsEmpty());
  for (int second = 4; second < 60; ++second)
    EXPECT_THAT(report(1, second, {}, {2 + second % 10}), IsEmpty()) << second;
}

TEST_F(TagWatchTest, NorIsWhatItSaidBefore) {
  for (int i = 0; i < 2; ++i) (void)report(1, 1, {2, 3}, {7});
  (void)report(1, 2, {}, {2});
  for (int i = 0; i < 2; ++i)
    EXPECT_THAT(report(2, 3, {4, 5}, {7}), IsEmpty()) << "the first words that may be believed";
  EXPECT_EQ(report(2, 4, {4, 5}, {7}).size(), 1U);
}

TEST_F(TagWatchTest, ABodyThatFindsHardlyAnyTagInPlaceIsNotBelieved) {
  for (int second = 1; second < 60; ++second) EXPECT_THAT(report(1, second, {2}, {7}), IsEmpty());
}

TEST_F(TagWatchTest, NorIsOneThatFoundTheOthersLongAgo) {
  (void)report(1, 1, {2, 3, 4, 5});
  for (int second = 10; second < 60; ++second) EXPECT_THAT(report(1, second, {}, {7}), IsEmpty());
}

TEST_F(TagWatchTest, ABodyThatFindsThemInPlaceAgainIsBelievedAgain) {
  (void)report(1, 1, {}, {2, 3, 4});
  for (int i = 0; i < 2; ++i) EXPECT_THAT(report(1, 2, {2, 3, 4}, {7}), IsEmpty());
  EXPECT_EQ(report(1, 3, {2, 3, 4}, {7}).size(), 1U);
}

TEST_F(TagWatchTest, TwoTagsThatAreMovedTogetherAreGoneForABodyThatFindsSixOthers) {
  for (int i = 0; i < 2; ++i) (void)report(1, 2, {1, 2, 3, 4, 5, 6}, {7, 8});
  EXPECT_EQ(report(1, 3, {}, {7, 8}).size(), 2U);
}

TEST_F(TagWatchTest, WhoeverFindsTheTagInItsPlaceTakesWordsBack) {
  for (int i = 0; i < 2; ++i) (void)report(1, 1, {2, 3}, {7});
  (void)report(2, 2, {4, 7});
  EXPECT_THAT(report(1, 3, {2, 3}, {7}), IsEmpty());
}

TEST_F(TagWatchTest, NotABodyThatSeesNothingElse) {
  for (int i = 0; i < 2; ++i) (void)report(1, 1, {2, 3}, {7});
  (void)report(2, 2, {7});
  EXPECT_EQ(report(1, 3, {2, 3}, {7}).size(), 1U) << "what is seen alone fits wherever it is";
}

TEST_F(TagWatchTest, WordsAreForgottenAfterALongTime) {
  for (int i = 0; i < 2; ++i) (void)report(1, 1, {2, 3}, {7});
  EXPECT_THAT(report(1, 1000, {2, 3}, {7}), IsEmpty());
}

TEST_F(TagWatchTest, ATagWithANewPlaceIsAskedAboutAnew) {
  for (int i = 0; i < 2; ++i) (void)report(1, 1, {2, 3}, {7});
  watch_.forget(7);
  EXPECT_THAT(report(1, 2, {2, 3}, {7}), IsEmpty());
}

}  // namespace
}  // namespace fiducap
