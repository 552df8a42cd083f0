#include "estimation/update/contradictions.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <vector>

#include "base/pose.hpp"
#include "estimation/start/jump_search.hpp"
#include "example_tags.hpp"

namespace fiducap {
namespace {

Instant at_s(int seconds) { return Instant{std::chrono::seconds(seconds)}; }

TEST(TagHealth, CountsConsecutiveRejections) {
  TagHealth health;
  for (int i = 0; i < 4; ++i) health.note_sighting(7, false);
  health.note_sighting(8, false);
  EXPECT_EQ(health.rejected(7), 4);
  EXPECT_EQ(health.rejected(8), 1);
  EXPECT_EQ(health.rejected(9), 0);
  health.note_sighting(7, true);
  EXPECT_EQ(health.rejected(7), 0) << "one fit resets it";
  health.reset_rejections();
  EXPECT_EQ(health.rejected(8), 0);
}

class RemovedTag : public testing::Test {
 protected:
  void remove(int second) { tags_.note_removal(7, at_s(second)); }
  bool is_excluded(int second) { return tags_.is_excluded(7, at_s(second)); }
  TagHealth tags_;
};

TEST_F(RemovedTag, IsExcludedForLongerWithEachRemoval) {
  remove(10);
  EXPECT_FALSE(is_excluded(10));
  remove(20);
  EXPECT_TRUE(is_excluded(39));
  EXPECT_FALSE(is_excluded(41));
  remove(50);
  EXPECT_TRUE(is_excluded(89));
  EXPECT_FALSE(is_excluded(91));
  EXPECT_FALSE(tags_.is_excluded(8, at_s(51))) << "another tag";
}

TEST_F(RemovedTag, IsForgottenAfterHalfAnHour) {
  remove(10);
  remove(10 + 31 * 60);
  EXPECT_FALSE(is_excluded(11 + 31 * 60));
}

TEST_F(RemovedTag, IsRememberedAmongTheNewestIds) {
  for (int id = 0; id < 1000; ++id)
    for (const int second : {1, 2}) tags_.note_removal(id, at_s(second));
  EXPECT_FALSE(tags_.is_excluded(0, at_s(3)));
  EXPECT_TRUE(tags_.is_excluded(999, at_s(3)));
}

TEST(ContradictionsTest, CountsConsecutiveImages) {
  TagObservation seen;
  const std::vector<TagToUse> used{{&seen, 0, nullptr}, {&seen, 1, nullptr}};
  Contradictions contradictions;
  const Instant at{std::chrono::seconds(5)};
  contradictions.count(0, at, used, {true, false});
  EXPECT_EQ(contradictions.contradicting_images(), 1);
  EXPECT_EQ(contradictions.images_without_fit(), 0);
  contradictions.count(0, at + std::chrono::seconds(2), used, {false, false});
  EXPECT_EQ(contradictions.contradicting_images(), 2);
  EXPECT_EQ(contradictions.images_without_fit(), 1);
  EXPECT_DOUBLE_EQ(contradictions.seconds_without_fit(at + std::chrono::seconds(3)), 3.0);
  contradictions.count(0, at, used, {true, true});
  EXPECT_EQ(contradictions.contradicting_images(), 0);
}

constexpr double kByImu_m = 0.1;  // 1-sigma per axis of the motion since the last fit
const Eigen::Vector3d kForth(0.4, 0, 0);

/// The body returns by tag 7, which moves it along x.
PlaceDoubt returned(double by_m) {
  PlaceDoubt doubt;
  doubt.open(at_s(1), {-by_m, 0, 0}, kByImu_m * kByImu_m * Eigen::Matrix3d::Identity());
  doubt.add(7, std::nullopt);
  doubt.weigh();
  return doubt;
}

/// All tags that a body sees contradict the IMU, which is good to a centimetre.
PlaceDoubt contradicted(const std::vector<Eigen::Vector3d>& positions_W) {
  PlaceDoubt doubt;
  doubt.open(at_s(1), Eigen::Vector3d::Zero(), 1e-4 * Eigen::Matrix3d::Identity());
  int tag_id = 0;
  for (const Eigen::Vector3d& position_W : positions_W) doubt.add(tag_id++, position_W);
  doubt.weigh();
  return doubt;
}

TEST(PlaceDoubt, AReturnBySingleTagIsUnsureByWhatAMovedTagWouldExplain) {
  const auto sigma_m = [](const PlaceDoubt& doubt) { return std::sqrt(doubt.covariance()(0, 0)); };
  EXPECT_LT(sigma_m(returned(0.0)), 0.3 * kByImu_m) << "as expected by the IMU";
  EXPECT_GT(sigma_m(returned(0.4)), 0.4 / 4) << "four sigmas away: rather moved";
  EXPECT_GT(returned(0.4).probability(), 0.5);
  PlaceDoubt lost;
  lost.open(at_s(1), Eigen::Vector3d::Zero(), 900 * Eigen::Matrix3d::Identity());
  lost.add(7, std::nullopt);
  lost.weigh();
  EXPECT_NEAR(lost.probability(), PlaceDoubt::kMoved, 0.01) << "nothing is known but that";
  EXPECT_NEAR(sigma_m(lost), std::sqrt(PlaceDoubt::kMoved) * PlaceDoubt::kMovedBy_m, 0.02);
}

TEST(PlaceDoubt, AnotherTagDecidesWhetherTheFirstWasMoved) {
  PlaceDoubt fits = returned(0.2);
  fits.add(8, std::nullopt);
  fits.weigh();
  EXPECT_LT(fits.log_odds(), -6) << "both in place";
  PlaceDoubt was_moved = returned(0.3);
  was_moved.add(8, Eigen::Vector3d(-0.3, 0, 0));
  was_moved.weigh();
  EXPECT_GT(was_moved.log_odds(), 3) << "the other tag and the IMU agree";
  EXPECT_NEAR(was_moved.other_place_W().x(), -0.3, 0.05);
  PlaceDoubt other_was_moved = returned(0.01);
  other_was_moved.add(8, kForth);
  other_was_moved.weigh();
  EXPECT_LT(other_was_moved.log_odds(), -3) << "the first tag and the IMU agree";
  EXPECT_EQ(other_was_moved.contradicting_tag(), 8);
}

TEST(PlaceDoubt, TagsThatAgreeOutweighTheImu) {
  EXPECT_LT(contradicted({kForth}).log_odds(), 0) << "one tag was moved";
  EXPECT_LT(contradicted({0.25 * kForth}).log_odds(), 0) << "by a little";
  EXPECT_GT(contradicted({kForth}).probability(), 1.0 / 16) << "4 sigma of the mixture";
  EXPECT_GT(contradicted({kForth, kForth}).log_odds(), 3) << "the body is there";
  EXPECT_LT(contradicted({kForth, -kForth}).log_odds(), 0) << "two prints were exchanged";
}

TEST(PlaceDoubt, TheOtherPlaceBecomesTheEstimate) {
  PlaceDoubt doubt = contradicted({kForth, kForth, -kForth});
  doubt.change_place();
  EXPECT_LT(doubt.log_odds(), -3);
  EXPECT_FALSE(doubt.contradicts(0));
  EXPECT_TRUE(doubt.contradicts(2)) << "it was moved";
  EXPECT_FALSE(doubt.contradicts(9)) << "never seen";
}

TEST(PlaceDoubt, ATagThatContradictsIsAmongTheComparedOnes) {
  PlaceDoubt doubt;
  doubt.open(at_s(1), Eigen::Vector3d::Zero(), 1e-4 * Eigen::Matrix3d::Identity());
  for (int tag_id = 0; tag_id < 20; ++tag_id) doubt.add(tag_id, std::nullopt);
  doubt.add(20, kForth);
  doubt.weigh();
  EXPECT_EQ(doubt.contradicting_tag(), 20);
  EXPECT_LT(doubt.log_odds(), -6);
}

TEST(PlaceDoubt, ATagThatWasMovedOnceDoesNotDrift) {
  PlaceDoubt doubt = contradicted({kForth, kForth});
  for (int i = 0; i < 20; ++i) {
    doubt.add(0, kForth);
    doubt.add(1, (1 + 0.05 * i) * kForth);
  }
  EXPECT_FALSE(doubt.drifts(0));
  EXPECT_TRUE(doubt.drifts(1)) << "by 0.4 m in 20 images, as in a lift";
  EXPECT_FALSE(doubt.drifts(2)) << "never seen";
}

TEST(PlaceDoubt, FollowsTheEstimateAndTheAxes) {
  PlaceDoubt doubt = contradicted({kForth});
  const double odds = doubt.log_odds();
  const Eigen::Quaterniond q = exp_so3(Eigen::Vector3d(0, 0, 1));
  doubt.turn(q);
  doubt.weigh();
  EXPECT_NEAR((doubt.other_place_W() - q * kForth).norm(), 0, 0.02);
  doubt.move(q * kForth);
  EXPECT_NEAR(doubt.other_place_W().norm(), 0, 0.02);
  doubt.close();
  EXPECT_TRUE(doubt.covariance().isZero(0));
  EXPECT_LT(odds, 0);
}

constexpr double kLength_s = 3.0;

/// A body that swings about one place without repetition.
Pose body_at(double t_s) {
  return {exp_so3(Eigen::Vector3d(0.3 * std::sin(2.1 * t_s), 0.4 * std::sin(1.7 * t_s + 1),
                                  0.2 * std::sin(2.9 * t_s))),
          Eigen::Vector3d(0.4 * std::sin(1.3 * t_s), 0.3 * std::cos(2.3 * t_s),
                          0.2 * std::sin(1.9 * t_s))};
}

/// Tags before the camera, seen by it at `t_s`.
struct Scene {
  CameraModel camera = example_camera();
  std::vector<TagObservation> seen;
  std::vector<SightedTag> sighted;

  void look(double t_s, int tags, const Eigen::Vector3d& first_moved = Eigen::Vector3d::Zero()) {
    seen.clear();
    sighted.clear();
    seen.reserve(static_cast<std::size_t>(tags));
    for (int k = 0; k < tags; ++k) {
      const Pose X_WT{exp_so3({3.0, 0, 0}), {0.3 * k, 0.1, 2.0}};
      Pose shown = X_WT;
      if (k == 0) shown.p += first_moved;
      seen.push_back(example_observation(k, 0.2, body_at(t_s).inverse() * shown, camera));
      sighted.push_back({&seen.back(), &camera, Pose{}, X_WT});
    }
  }
};

Instant at(double t_s) { return Instant{} + from_seconds(t_s); }

/// Images that were exposed `jump_s` after their stamps, for `images_s` at the end.
JumpSearch search_over(double jump_s, int tags, double images_s,
                       const Eigen::Vector3d& moved = Eigen::Vector3d::Zero()) {
  JumpSearch search;
  for (double t_s = 0; t_s <= kLength_s; t_s += 0.005) search.note_motion(at(t_s), body_at(t_s));
  Scene scene;
  for (double t_s = kLength_s - images_s; t_s <= kLength_s - 0.25; t_s += 0.05) {
    scene.look(t_s + jump_s, tags, moved);
    search.note_image(0, at(t_s), scene.sighted);
  }
  return search;
}

TEST(JumpSearch, FindsWhenImagesWereExposedRelativeToTheAppliedShift) {
  struct Case {
    double jump_s;
    int tags;  // one is enough after a swing
    double images_s, applied_s;
  };
  for (const auto& [jump_s, tags, images_s, applied_s] : {Case{-0.5, 2, 1, 0},
                                                          {-0.2, 2, 1, 0},
                                                          {-0.06, 2, 1, 0},
                                                          {0.06, 2, 1, 0},
                                                          {0.2, 2, 1, 0},
                                                          {0.3, 2, 1, 0.1},
                                                          {-0.2, 1, 1.2, 0}}) {
    const auto found = search_over(jump_s, tags, images_s).find(0, from_seconds(applied_s));
    ASSERT_TRUE(found) << jump_s;
    EXPECT_NEAR(found->shift_s, jump_s - applied_s, 0.01);
    EXPECT_TRUE(found->is_certain) << jump_s;
  }
}

TEST(JumpSearch, KeepsThreeSecondsOfFastReadings) {
  JumpSearch search;
  for (double t_s = 0; t_s <= kLength_s; t_s += 0.002) search.note_motion(at(t_s), body_at(t_s));
  Scene scene;
  for (double t_s = kLength_s - 2.5; t_s <= kLength_s - 1.5; t_s += 0.05) {
    scene.look(t_s - 0.1, 2, Eigen::Vector3d::Zero());
    search.note_image(0, at(t_s), scene.sighted);
  }
  EXPECT_TRUE(search.find(0, Duration{0}));
}

TEST(JumpSearch, FindsNothingWithoutAJumpOrABodyPose) {
  EXPECT_FALSE(search_over(0.0, 2, 1.0).find(0, Duration{0}));
  JumpSearch search = search_over(0.2, 2, 1.0);
  EXPECT_FALSE(search.find(1, Duration{0})) << "another camera";
  search.forget_all();
  EXPECT_FALSE(search.find(0, Duration{0}));
}

TEST(JumpSearch, AMovedTagIsNoJump) {
  for (const double images_s : {0.6, 0.8, 1.2}) {
    const auto found = search_over(0.0, 1, images_s, {0.2, -0.2, 0.1}).find(0, Duration{0});
    EXPECT_FALSE(found && found->is_certain) << images_s;
  }
}

}  // namespace
}  // namespace fiducap
