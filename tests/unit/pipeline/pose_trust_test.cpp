#include "pipeline/pose_trust.hpp"

#include <gmock/gmock.h>

namespace fiducap {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(50);

/// A body in a room that is not known, with images of two tags.
class PoseTrustTest : public testing::Test {
 protected:
  /// @return whether poses are withheld after that many images
  bool fitting(int count) { return images(count, 2, 0); }
  bool contradicting(int count) { return images(count, 0, 2); }
  bool images(int count, int used, int rejected) {
    for (int i = 0; i < count; ++i) {
      report_.exposed_at = now_ += kPeriod;
      report_.tags_used = used;
      report_.tags_rejected = rejected;
      trust_.add(report_, is_established_, is_room_known_);
    }
    return trust_.withholds();
  }
  /// An image at which a single tag relocalises the body.
  bool relocalised_by_one_tag() {
    report_.relocalised_by_one_tag = true;
    const bool withholds = fitting(1);
    report_.relocalised_by_one_tag = false;
    return withholds;
  }
  /// Camera and gyro agree, poses were published.
  void establish() {
    is_established_ = true;
    EXPECT_FALSE(fitting(60));
  }

  PoseTrust trust_;
  UpdateReport report_{.generation = 1};
  Instant now_{};
  bool is_established_{false};
  bool is_room_known_{false};
};

TEST_F(PoseTrustTest, AnUnknownRoomIsShownAfterTwoFittingSeconds) {
  EXPECT_TRUE(fitting(30));
  EXPECT_FALSE(fitting(12));
  EXPECT_FALSE(trust_.is_contradicted());
}

TEST_F(PoseTrustTest, AContradictionInAnUnknownRoomCostsTwoSeconds) {
  fitting(30);
  contradicting(1);
  EXPECT_TRUE(fitting(30));
  EXPECT_FALSE(fitting(12));
}

TEST_F(PoseTrustTest, AnUnknownRoomWithContradictionsIsShownAfterTenSeconds) {
  for (int i = 0; i < 13; ++i) {
    EXPECT_EQ(fitting(19), i < 12) << i;
    contradicting(1);
  }
}

TEST_F(PoseTrustTest, AKnownRoomIsShownAtOnceButTestedAfterARestart) {
  is_room_known_ = true;
  EXPECT_FALSE(fitting(1));
  fitting(9);
  report_.generation = 2;
  EXPECT_TRUE(fitting(10));
}

TEST_F(PoseTrustTest, WithholdsNothingOnceCamerasAndGyroAgree) {
  is_established_ = true;
  EXPECT_FALSE(contradicting(5));
}

TEST_F(PoseTrustTest, WithholdsAtOnceAndReportsLongContradictions) {
  fitting(60);
  EXPECT_TRUE(contradicting(3));
  EXPECT_FALSE(trust_.is_contradicted());
  contradicting(80);
  EXPECT_TRUE(trust_.is_contradicted());
  EXPECT_TRUE(fitting(41));
  EXPECT_FALSE(fitting(12));
}

TEST_F(PoseTrustTest, RareWrongIdsAreNoContradiction) {
  fitting(60);
  for (int i = 0; i < 20; ++i) {
    contradicting(1);
    EXPECT_FALSE(fitting(9));
  }
}

TEST_F(PoseTrustTest, ARelocalisedBodyIsShownAfterFittingImages) {
  establish();
  report_.relocalised = true;
  contradicting(1);
  report_.relocalised = false;
  EXPECT_TRUE(fitting(35));
  EXPECT_FALSE(fitting(10));
}

TEST_F(PoseTrustTest, WaitsAtMostFourteenSecondsForConsecutiveFits) {
  for (int i = 0; i < 40; ++i) {
    contradicting(1);
    fitting(6);
  }
  EXPECT_FALSE(trust_.withholds());
}

TEST_F(PoseTrustTest, ARestartInAnUnknownRoomStartsTheCountAgain) {
  fitting(30);
  report_.generation = 2;
  fitting(30);
  EXPECT_TRUE(trust_.is_untested());
  EXPECT_FALSE(trust_.is_contradicted());
  EXPECT_FALSE(fitting(12));
}

TEST_F(PoseTrustTest, ATagThatRelocalisesABodyAloneHasToFitForHalfASecond) {
  establish();
  relocalised_by_one_tag();
  EXPECT_TRUE(fitting(9));
  EXPECT_TRUE(trust_.is_untested());
  EXPECT_FALSE(fitting(2));
}

TEST_F(PoseTrustTest, ATagThatRelocalisedAloneAndIsContradictedCostsTwoSeconds) {
  establish();
  relocalised_by_one_tag();
  fitting(5);
  EXPECT_TRUE(contradicting(3));
  EXPECT_FALSE(trust_.is_untested());
  EXPECT_TRUE(fitting(35));
  EXPECT_FALSE(fitting(20));
}

TEST_F(PoseTrustTest, ASingleTagAfterAGapStartsTheCountAgain) {
  fitting(40);
  EXPECT_TRUE(relocalised_by_one_tag());
  EXPECT_TRUE(fitting(39));
  EXPECT_FALSE(fitting(3));
}

TEST_F(PoseTrustTest, AClockJumpStartsTheCountAgainWithoutAReport) {
  establish();
  trust_.note_clock_jump();
  EXPECT_TRUE(fitting(35));
  contradicting(100);
  EXPECT_FALSE(trust_.is_contradicted());
  EXPECT_FALSE(fitting(60));
}

TEST_F(PoseTrustTest, HalfOfTheTagsKeepsTrustButDoesNotGiveIt) {
  contradicting(10);
  EXPECT_TRUE(images(100, 1, 1));
  EXPECT_FALSE(fitting(60));
  EXPECT_FALSE(images(100, 1, 1));
}

TEST_F(PoseTrustTest, DoesNotTrustAtAnImageThatContradicts) {
  contradicting(10);
  fitting(47);
  EXPECT_TRUE(contradicting(1));
  EXPECT_FALSE(fitting(1));
}

class LateImagesTest : public testing::Test {
 protected:
  using Change = LateImages::Change;
  static constexpr Duration kBehind = std::chrono::milliseconds(540);

  /// @return number of images until a change; 0: it does not happen within `most`
  int images_until(Change wanted, Duration behind, int most, int dropped_of_ten) {
    for (int i = 1; i <= most; ++i) {
      stamp_ += kPeriod;
      if (late_.note(0, stamp_, i % 10 < dropped_of_ten, stamp_ + behind) == wanted) return i;
    }
    return 0;
  }

  LateImages late_{2};
  Instant stamp_{};
};

TEST_F(LateImagesTest, ExcludesACameraWhoseImagesAreAllLate) {
  EXPECT_FALSE(late_.is_excluded(0));
  EXPECT_EQ(images_until(Change::kExcluded, kBehind, 200, 9), 0) << "a slow computer";
  late_ = LateImages(2);
  stamp_ = {};
  EXPECT_EQ(images_until(Change::kExcluded, kBehind, 200, 10), 50);
  EXPECT_TRUE(late_.excludes(0, {}));
  EXPECT_FALSE(late_.excludes(1, Instant{} + kPeriod));
  EXPECT_THAT(late_.text(0), testing::HasSubstr("stamped 0.54 s before"));
  EXPECT_TRUE(late_.is_excluded(0));
  EXPECT_FALSE(late_.is_excluded(1));
}

TEST_F(LateImagesTest, UsesACameraAgainAfterAsManyImagesInTime) {
  ASSERT_NE(images_until(Change::kExcluded, kBehind, 100, 10), 0);
  EXPECT_TRUE(late_.is_excluded(0));
  EXPECT_EQ(images_until(Change::kInTime, kBehind, 200, 0), 0) << "still late";
  EXPECT_EQ(images_until(Change::kInTime, kPeriod, 200, 0), 50);
  EXPECT_FALSE(late_.excludes_any());
  EXPECT_TRUE(late_.excludes(0, stamp_)) << "was on its way, placed by the wrong clock";
  EXPECT_FALSE(late_.excludes(0, stamp_ + kPeriod));
  ASSERT_NE(images_until(Change::kExcluded, kBehind, 100, 10), 0);
  EXPECT_TRUE(late_.is_excluded(0)) << "again";
}

}  // namespace
}  // namespace fiducap
