#include "estimation/update/contradictions.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

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

TEST_F(TagScoresTest, ATagThatContradictsTenTimesIsRemoved) {
  for (int i = 1; i < TagScores::kToDrop; ++i)
    EXPECT_TRUE(show({0, 1, 2}, {true, false, true}).empty()) << i;
  EXPECT_EQ(show({0, 1, 2}, {true, false, true}), std::vector<int>{1});
  EXPECT_TRUE(show({0, 1, 2}, {true, false, true}).empty()) << "the count starts again";
}

TEST_F(TagScoresTest, OneFitResetsTheCount) {
  for (int i = 1; i < TagScores::kToDrop; ++i) show({0, 1}, {true, false});
  show({0, 1}, {true, true});
  EXPECT_TRUE(show({0, 1}, {true, false}).empty());
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

TEST(SingleTagRelocalisation, IsWatchedUntilItIsForgotten) {
  SingleTagRelocalisation single = relocalised(0.02, false);
  EXPECT_TRUE(single.is_watched());
  EXPECT_EQ(single.tag_id(), 7);
  single.forget();
  EXPECT_FALSE(single.is_watched());
}

}  // namespace
}  // namespace fiducap
