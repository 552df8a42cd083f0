#include "pipeline/doubts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/pose.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

constexpr double kQuarter = 1.5707963267948966;

/// In a room whose z is up; `q_WR` then lays the room on its side.
class UpCheckTest : public testing::Test {
 protected:
  void add(const Eigen::Quaterniond& q_RT, int sightings = 50) {
    TagBelief belief;
    belief.tag.tag_id = static_cast<int>(tags_.size());
    belief.tag.X_WT.q = q_WR * q_RT;
    belief.sightings = sightings;
    tags_.push_back(belief);
  }
  /// Upright on a wall that faces this way, inclined by an angle.
  void hang(double heading, double crooked_rad = 0) {
    add(exp_so3({0, 0, heading}) * exp_so3({kQuarter, 0, 0}) * exp_so3({0, 0, crooked_rad}));
  }
  void lay(double heading) { add(exp_so3({0, 0, heading})); }
  std::string look(UpCheck& check, bool anchored = true, const std::vector<KnownTag>& known = {}) {
    now_ += std::chrono::milliseconds(1100);
    BodyEstimate estimate;
    estimate.anchored = anchored;
    return check.add(now_, estimate, tags_, known);
  }

  Eigen::Quaterniond q_WR{Eigen::Quaterniond::Identity()};
  std::vector<TagBelief> tags_;
  Instant now_{};
};

TEST_F(UpCheckTest, TagsOnTwoWallsSayWhatIsUp) {
  q_WR = exp_so3({-kQuarter, 0, 0});
  hang(0, 0.03);
  hang(0, -0.02);
  hang(kQuarter, 0.04);
  hang(-kQuarter);
  const auto guess = guess_up(tags_);
  ASSERT_TRUE(guess);
  EXPECT_GT(guess->up_W.dot(q_WR * Eigen::Vector3d::UnitZ()), std::cos(0.05));
  EXPECT_EQ(guess->agree, 4);
}

TEST_F(UpCheckTest, TagsOnAFloorThatPointAnywhereAndOneOnAWallSayIt) {
  lay(0.3);
  lay(2.1);
  lay(-1.2);
  hang(0.5);
  ASSERT_TRUE(guess_up(tags_));
  EXPECT_GT(guess_up(tags_)->up_W.z(), 0.99);
}

TEST_F(UpCheckTest, OneWallLooksLikeOneFloor) {
  for (int i = 0; i < 5; ++i) hang(0.4);
  EXPECT_FALSE(guess_up(tags_));
}

TEST_F(UpCheckTest, TwoTagsOrSuchAsWereHardlySeenSayNothing) {
  hang(0);
  hang(kQuarter);
  add(exp_so3({0, 0, 3}) * exp_so3({kQuarter, 0, 0}), 3);
  EXPECT_FALSE(guess_up(tags_));
}

TEST_F(UpCheckTest, AWorkspaceThatLiesOnItsSideIsSaidOnceWithARemedy) {
  q_WR = exp_so3({-kQuarter, 0, 0});
  hang(0);
  UpCheck check(false, {}, false);
  EXPECT_EQ(look(check, false), "");
  EXPECT_THAT(look(check), testing::AllOf(HasSubstr("without an IMU the vertical is unknown"),
                                          HasSubstr("map.floor_tags")));
  EXPECT_EQ(look(check), "") << "one tag tells no more";
  hang(kQuarter);
  hang(-kQuarter);
  EXPECT_THAT(look(check),
              testing::AllOf(HasSubstr("seems to lie on its side: by 3 of 3 tags, up is "
                                       "90 deg from its z axis, about along +y"),
                             HasSubstr("map.floor_tags")));
  EXPECT_EQ(look(check), "");
}

TEST_F(UpCheckTest, AGoodGuessIsCalledGood) {
  lay(0);
  hang(0);
  hang(kQuarter);
  UpCheck check(false, {}, false);
  look(check);
  EXPECT_THAT(look(check), HasSubstr("3 of 3 tags agree"));
}

TEST_F(UpCheckTest, NothingIsSaidWhereSomethingSaysWhatIsUp) {
  hang(0);
  hang(kQuarter);
  hang(-kQuarter);
  WorkspaceGauge placed;
  placed.X_WT = Pose{};
  WorkspaceGauge floor;
  floor.floor_tags = {0};
  UpCheck with_imu(true, {}, false);
  UpCheck with_place(false, placed, false);
  UpCheck with_survey(false, {}, true);
  UpCheck with_floor(false, floor, false);
  UpCheck with_map(false, {}, false);
  for (int i = 0; i < 3; ++i) {
    for (UpCheck* check : {&with_imu, &with_place, &with_survey, &with_floor})
      EXPECT_EQ(look(*check), "");
    EXPECT_EQ(look(with_map, true, {KnownTag{}}), "");
  }
}

TEST_F(UpCheckTest, FloorTagsThatAreNotSeenAreNamed) {
  hang(0);
  WorkspaceGauge gauge;
  gauge.floor_tags = {0, 7, 9};
  UpCheck check(false, gauge, false);
  std::string said;
  for (int i = 0; i < 30; ++i) said += look(check, false);
  EXPECT_THAT(said, HasSubstr("of them 7, 9 was not seen well"));
  EXPECT_EQ(said.find("no pose yet"), said.rfind("no pose yet")) << "said once";
}

}  // namespace
}  // namespace fiducap
