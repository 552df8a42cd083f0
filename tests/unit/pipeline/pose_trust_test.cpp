#include "pipeline/pose_trust.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(50);

struct Body {
  PoseTrust trust;
  Instant now{};
  int generation{1};
  bool is_established{false};
  bool is_room_known{false};
  bool is_relocalised{false};
  bool is_alone{false};

  void images(int count, bool fit) { images(count, fit ? 2 : 0, fit ? 0 : 2); }
  void images(int count, int used, int rejected) {
    for (int i = 0; i < count; ++i) {
      UpdateReport report;
      report.exposed_at = now += kPeriod;
      report.generation = generation;
      report.relocalised = is_relocalised;
      report.relocalised_by_one_tag = is_alone;
      report.tags_used = used;
      report.tags_rejected = rejected;
      trust.add(report, is_established, is_room_known);
    }
  }
};

TEST(PoseTrust, ANewRoomIsShownWhenImagesHaveFittedForTwoSeconds) {
  Body body;
  body.images(30, true);
  EXPECT_TRUE(body.trust.withholds());
  body.images(12, true);
  EXPECT_FALSE(body.trust.withholds());
  EXPECT_FALSE(body.trust.take_report());
}

TEST(PoseTrust, InANewRoomOneContradictionCostsTwoSecondsAndForTenSecondsOnly) {
  Body body;
  body.images(30, true);
  body.images(1, false);
  body.images(30, true);
  EXPECT_TRUE(body.trust.withholds());
  body.images(12, true);
  EXPECT_FALSE(body.trust.withholds());
  Body misread;
  for (int i = 0; i < 13; ++i) {
    misread.images(19, true);
    EXPECT_EQ(misread.trust.withholds(), i < 12) << i;
    misread.images(1, false);
  }
}

TEST(PoseTrust, AKnownRoomIsShownAtOnce) {
  Body body;
  body.is_room_known = true;
  body.images(1, true);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, OnceCamerasAndGyroAgreeNothingIsWithheld) {
  Body body;
  body.is_established = true;
  body.images(5, false);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, ContradictionsAreWithheldAtOnceAndSaidAfterAWhile) {
  Body body;
  body.images(60, true);
  body.images(3, false);
  EXPECT_TRUE(body.trust.withholds());
  EXPECT_FALSE(body.trust.take_report());
  body.images(80, false);
  EXPECT_TRUE(body.trust.take_report());
  EXPECT_FALSE(body.trust.take_report());
  body.images(41, true);
  EXPECT_TRUE(body.trust.withholds());
  body.images(12, true);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, AWrongIdNowAndThenIsNoContradiction) {
  Body body;
  body.images(60, true);
  for (int i = 0; i < 20; ++i) {
    body.images(1, false);
    body.images(9, true);
    EXPECT_FALSE(body.trust.withholds());
  }
}

TEST(PoseTrust, ABodyThatWasFoundAnewIsShownWhenImagesHaveFittedAgain) {
  Body body;
  body.is_established = true;
  body.images(60, true);
  EXPECT_FALSE(body.trust.withholds());
  body.is_relocalised = true;
  body.images(1, false);
  body.is_relocalised = false;
  body.images(35, true);
  EXPECT_TRUE(body.trust.withholds());
  body.images(10, true);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, NobodyWaitsForEverForImagesOfWhichEachFits) {
  Body body;
  for (int i = 0; i < 40; ++i) {  // 14 s
    body.images(1, false);
    body.images(6, true);
  }
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, ANewRoomsStartMayBeTriedAgainButFitsCountAnew) {
  Body body;
  body.images(30, true);
  body.generation = 2;
  body.images(30, true);
  EXPECT_TRUE(body.trust.is_untested());
  EXPECT_FALSE(body.trust.take_report());
  body.images(12, true);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, AFilterThatForgetsEverythingIsDoubtedAlsoInAKnownRoom) {
  Body body;
  body.is_room_known = true;
  body.images(10, true);
  body.generation = 2;
  body.images(10, true);
  EXPECT_TRUE(body.trust.withholds());
}

/// Cameras and gyro agree, poses were published; then a single tag relocalised the body.
Body relocalised_by_one_tag() {
  Body body;
  body.is_established = true;
  body.images(60, true);
  EXPECT_FALSE(body.trust.withholds());
  body.is_alone = true;
  body.images(1, true);
  body.is_alone = false;
  return body;
}

TEST(PoseTrust, OneTagThatBringsALostBodyBackHasToFitForHalfASecond) {
  Body body = relocalised_by_one_tag();
  body.images(9, true);
  EXPECT_TRUE(body.trust.withholds());
  EXPECT_TRUE(body.trust.is_untested());
  body.images(2, true);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, OneTagThatBroughtABodyBackAndIsContradictedCostsTwoSeconds) {
  Body body = relocalised_by_one_tag();
  body.images(5, true);
  body.images(3, false);
  EXPECT_TRUE(body.trust.withholds());
  EXPECT_FALSE(body.trust.is_untested());
  body.images(35, true);
  EXPECT_TRUE(body.trust.withholds());
  body.images(20, true);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, InANewRoomOneTagAfterAGapCountsAnew) {
  Body body;
  body.images(40, true);
  body.is_alone = true;
  body.images(1, true);
  body.is_alone = false;
  EXPECT_TRUE(body.trust.withholds());
  body.images(39, true);
  EXPECT_TRUE(body.trust.withholds());
  body.images(3, true);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, AfterAClockHasJumpedImagesHaveToFitAnewWithoutASecondWord) {
  Body body;
  body.is_established = true;
  body.images(60, true);
  body.trust.note_clock_jump();
  body.images(35, true);
  EXPECT_TRUE(body.trust.withholds());
  body.images(100, false);
  EXPECT_FALSE(body.trust.take_report());
  body.images(60, true);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, HalfOfTheTagsProvesNothingToWhoHasNoProofYet) {
  Body body;
  body.images(10, false);
  body.images(100, 1, 1);
  EXPECT_TRUE(body.trust.withholds());
  body.images(60, true);
  EXPECT_FALSE(body.trust.withholds());
  body.images(100, 1, 1);
  EXPECT_FALSE(body.trust.withholds());
}

TEST(PoseTrust, NobodyIsBelievedWithAnImageThatContradicts) {
  Body body;
  body.images(10, false);
  body.images(47, true);
  body.images(1, false);
  EXPECT_TRUE(body.trust.withholds());
  body.images(1, true);
  EXPECT_FALSE(body.trust.withholds());
}

}  // namespace
}  // namespace fiducap
