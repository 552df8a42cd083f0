#include "estimation/update/contradictions.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "base/pose.hpp"
#include "estimation/start/jump_search.hpp"
#include "example_tags.hpp"

namespace fiducap {
namespace {

class TagScoresTest : public testing::Test {
 protected:
  TagScoresTest() {
    for (int i = 0; i < 3; ++i) seen_[static_cast<std::size_t>(i)].tag_id = i;
  }
  /// @param accepted  by tag id
  std::vector<int> show(std::vector<int> ids, std::vector<bool> accepted) {
    std::vector<TagToUse> used;
    for (const int id : ids) used.push_back({&seen_[static_cast<std::size_t>(id)], -1, nullptr});
    const auto gone = scores_.count(used, accepted);
    return {gone.begin(), gone.end()};
  }

  std::array<TagObservation, 3> seen_{};
  TagScores scores_;
};

TEST_F(TagScoresTest, ATagThatContradictsTenTimesInARowIsRemoved) {
  for (int i = 1; i < TagScores::kToDrop; ++i)
    EXPECT_TRUE(show({0, 1, 2}, {true, false, true}).empty()) << i;
  EXPECT_EQ(show({0, 1, 2}, {true, false, true}), std::vector<int>{1});
  EXPECT_TRUE(show({0, 1, 2}, {true, false, true}).empty()) << "the count starts again";
  for (int i = 2; i < TagScores::kToDrop; ++i) show({0, 1}, {true, false});
  show({0, 1}, {true, true});
  EXPECT_TRUE(show({0, 1}, {true, false}).empty()) << "one fit resets it";
}

TEST_F(TagScoresTest, ASingleTagIsRemovedOnceAnotherFits) {
  for (int i = 0; i < 2 * TagScores::kToDrop; ++i) EXPECT_TRUE(show({1}, {false}).empty());
  EXPECT_TRUE(scores_.is_doubtful(1));
  EXPECT_EQ(scores_.doubtful(), 1);
  EXPECT_EQ(show({0}, {true}), std::vector<int>{1});
}

TEST_F(TagScoresTest, NoTagIsRemovedWhenAllContradict) {
  for (int i = 0; i < 2 * TagScores::kToDrop; ++i) show({1, 2}, {false, false});
  EXPECT_TRUE(show({0}, {true}).empty());
  EXPECT_EQ(scores_.doubtful(), 0);
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

Instant at_s(int seconds) { return Instant{std::chrono::seconds(seconds)}; }

class UnstableTagsTest : public testing::Test {
 protected:
  void remove(int second) { tags_.note_removal(7, at_s(second)); }
  bool is_excluded(int second) { return tags_.is_excluded(7, at_s(second)); }
  UnstableTags tags_;
};

TEST_F(UnstableTagsTest, AreExcludedForLongerWithEachRemoval) {
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

TEST_F(UnstableTagsTest, AreForgottenAfterHalfAnHour) {
  remove(10);
  remove(10 + 31 * 60);
  EXPECT_FALSE(is_excluded(11 + 31 * 60));
}

TEST_F(UnstableTagsTest, TheNewestOfManyIdsAreRemembered) {
  for (int id = 0; id < 1000; ++id)
    for (const int second : {1, 2}) tags_.note_removal(id, at_s(second));
  EXPECT_FALSE(tags_.is_excluded(0, at_s(3)));
  EXPECT_TRUE(tags_.is_excluded(999, at_s(3)));
}

using Verdict = SingleTagRelocalisation::Verdict;
using Shift = std::optional<Eigen::Vector3d>;

constexpr double kSigma_m = 0.1;  // of the body's position by the IMU alone, per axis
const Shift kForth = Eigen::Vector3d(0.3, 0, 0);
const Shift kBack = Eigen::Vector3d(-0.3, 0, 0);

/// A tag that has moved the body along x.
SingleTagRelocalisation relocalised(double by_m, bool has_imu = true) {
  SingleTagRelocalisation single;
  const BodyPlace by_imu{Eigen::Vector3d::Zero(),
                         kSigma_m * kSigma_m * Eigen::Matrix3d::Identity()};
  single.begin(7, has_imu ? std::optional(by_imu) : std::nullopt, {by_m, 0.0, 0.0});
  return single;
}

/// Verdict after a number of images in which the tags `against` contradict.
Verdict after(int images, SingleTagRelocalisation single, const std::vector<int>& against,
              const Shift& shift) {
  Verdict verdict = Verdict::kOpen;
  for (int i = 0; i < images && verdict == Verdict::kOpen; ++i)
    verdict = single.contradict(against, shift);
  return verdict;
}

TEST(SingleTagRelocalisation, ThePoseIsUnsureByWhatAMovedTagWouldExplain) {
  const auto sigma_m = [](const SingleTagRelocalisation& single) {
    return std::sqrt(single.mixture()(0, 0));
  };
  EXPECT_LT(sigma_m(relocalised(0.0)), 0.2 * kSigma_m) << "as expected by the IMU";
  EXPECT_GT(sigma_m(relocalised(0.3)), 0.3 / 4) << "three sigmas away: rather moved";
  EXPECT_GT(sigma_m(relocalised(1.0, false)), 0.1) << "nothing is known";
  SingleTagRelocalisation single = relocalised(0.3);
  single.forget();
  EXPECT_TRUE(single.mixture().isZero(0));
}

TEST(SingleTagRelocalisation, IsDecidedByTheImuAndTheNumberOfOtherTags) {
  struct Case {
    const char* what;
    int images;
    SingleTagRelocalisation single;
    std::vector<int> against;
    Shift shift;
    Verdict verdict;
  };
  const Case cases[] = {
      {"too early", 4, relocalised(0.02), {8}, kForth, Verdict::kOpen},
      {"agrees with the IMU", 5, relocalised(0.02), {8}, kForth, Verdict::kOthersWrong},
      {"moved the body far, another moves it back",
       5,
       relocalised(0.3),
       {8},
       kBack,
       Verdict::kTagWrong},
      {"two others", 5, relocalised(0.02), {8, 9}, kForth, Verdict::kTagWrong},
      {"without an IMU", 5, relocalised(0.02, false), {8}, kForth, Verdict::kTagWrong},
      {"the other gives no position", 5, relocalised(0.02), {8}, std::nullopt, Verdict::kTagWrong}};
  for (const auto& [what, images, single, against, shift, verdict] : cases)
    EXPECT_EQ(after(images, single, against, shift), verdict) << what;
}

TEST(SingleTagRelocalisation, TwoOtherTagsInSequenceDecide) {
  SingleTagRelocalisation single = relocalised(0.02);
  ASSERT_EQ(single.contradict(std::vector{8}, kForth), Verdict::kOpen);
  EXPECT_EQ(after(4, single, {9}, kForth), Verdict::kTagWrong);
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
