#include "pipeline/agreement/pose_trust.hpp"

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

  void images(int count, bool fit) {
    for (int i = 0; i < count; ++i) {
      UpdateReport report;
      report.exposed_at = now += kPeriod;
      report.generation = generation;
      report.relocalised = is_relocalised;
      (fit ? report.tags_used : report.tags_rejected) = 2;
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
  EXPECT_FALSE(body.trust.take_news());
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
  EXPECT_FALSE(body.trust.take_news());
  body.images(80, false);
  EXPECT_TRUE(body.trust.take_news());
  EXPECT_FALSE(body.trust.take_news());
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
  EXPECT_TRUE(body.trust.is_new());
  EXPECT_FALSE(body.trust.take_news());
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

}  // namespace
}  // namespace fiducap
