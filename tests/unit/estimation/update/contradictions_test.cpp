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

TEST_F(TagScoresTest, ATagThatContradictsTheOthersTenTimesIsRemoved) {
  for (int i = 1; i < TagScores::kToDrop; ++i)
    EXPECT_TRUE(show({0, 1, 2}, {true, false, true}).empty()) << i;
  EXPECT_EQ(show({0, 1, 2}, {true, false, true}), std::vector<int>{1});
  EXPECT_TRUE(show({0, 1, 2}, {true, false, true}).empty()) << "its count starts again";
}

TEST_F(TagScoresTest, OneFitResetsATag) {
  for (int i = 1; i < TagScores::kToDrop; ++i) show({0, 1}, {true, false});
  show({0, 1}, {true, true});
  EXPECT_TRUE(show({0, 1}, {true, false}).empty());
}

TEST_F(TagScoresTest, ASingleTagIsRemovedOnlyOnceAnotherFits) {
  for (int i = 0; i < 2 * TagScores::kToDrop; ++i) EXPECT_TRUE(show({1}, {false}).empty());
  EXPECT_TRUE(scores_.is_doubtful(1));
  EXPECT_EQ(scores_.doubtful(), 1);
  EXPECT_EQ(show({0}, {true}), std::vector<int>{1});
}

TEST_F(TagScoresTest, WhenAllContradictTheFilterMayBeWrong) {
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

TEST(UnstableTags, AreNotExcludedAfterOneRemoval) {
  UnstableTags tags;
  tags.note_removal(7, at_s(10));
  EXPECT_FALSE(tags.is_excluded(7, at_s(10)));
}

TEST(UnstableTags, AreExcludedForLongerWithEachRemoval) {
  UnstableTags tags;
  tags.note_removal(7, at_s(10));
  tags.note_removal(7, at_s(20));
  EXPECT_TRUE(tags.is_excluded(7, at_s(39)));
  EXPECT_FALSE(tags.is_excluded(7, at_s(41)));
  tags.note_removal(7, at_s(50));
  EXPECT_TRUE(tags.is_excluded(7, at_s(89)));
  EXPECT_FALSE(tags.is_excluded(7, at_s(91)));
  EXPECT_FALSE(tags.is_excluded(8, at_s(51))) << "another tag";
}

TEST(UnstableTags, AreForgottenAfterHalfAnHour) {
  UnstableTags tags;
  tags.note_removal(7, at_s(10));
  tags.note_removal(7, at_s(10 + 31 * 60));
  EXPECT_FALSE(tags.is_excluded(7, at_s(11 + 31 * 60)));
}

TEST(UnstableTags, RememberTheNewestOfManyIds) {
  UnstableTags tags;
  for (int id = 0; id < 1000; ++id) {
    tags.note_removal(id, at_s(1));
    tags.note_removal(id, at_s(2));
  }
  EXPECT_FALSE(tags.is_excluded(0, at_s(3)));
  EXPECT_TRUE(tags.is_excluded(999, at_s(3)));
}

using Verdict = SingleTagRelocalisation::Verdict;

constexpr int kSingleTag = 7;
// Position of the body by the IMU alone, per axis.
constexpr double kSigma_m = 0.1;

BodyPlace by_imu() {
  return {Eigen::Vector3d::Zero(), kSigma_m * kSigma_m * Eigen::Matrix3d::Identity()};
}

/// Verdict after a number of contradicting images.
Verdict after(int images, SingleTagRelocalisation single, const std::vector<int>& against,
              const std::optional<Eigen::Vector3d>& shift) {
  Verdict verdict = Verdict::kOpen;
  for (int i = 0; i < images && verdict == Verdict::kOpen; ++i)
    verdict = single.contradict(against, shift);
  return verdict;
}

TEST(SingleTagRelocalisation, ATagThatAgreesWithTheImuIsKeptAgainstOneThatDoesNot) {
  SingleTagRelocalisation single;
  single.begin(kSingleTag, by_imu(), {0.02, 0.0, 0.0});
  EXPECT_EQ(after(4, single, {8}, Eigen::Vector3d(0.3, 0, 0)), Verdict::kOpen) << "too soon";
  EXPECT_EQ(after(5, single, {8}, Eigen::Vector3d(0.3, 0, 0)), Verdict::kOthersWrong);
}

TEST(SingleTagRelocalisation, ATagThatMovedTheBodyFarIsWrongWhenAnotherMovesItBack) {
  SingleTagRelocalisation single;
  single.begin(kSingleTag, by_imu(), {0.3, 0.0, 0.0});
  EXPECT_EQ(after(5, single, {8}, Eigen::Vector3d(-0.3, 0, 0)), Verdict::kTagWrong);
}

TEST(SingleTagRelocalisation, TwoContradictingTagsOutvoteIt) {
  SingleTagRelocalisation single;
  single.begin(kSingleTag, by_imu(), {0.02, 0.0, 0.0});
  EXPECT_EQ(after(5, single, {8, 9}, Eigen::Vector3d(0.3, 0, 0)), Verdict::kTagWrong);
}

TEST(SingleTagRelocalisation, TwoTagsThatContradictInSequenceOutvoteItToo) {
  SingleTagRelocalisation single;
  single.begin(kSingleTag, by_imu(), {0.02, 0.0, 0.0});
  const std::vector<int> one{8}, other{9};
  ASSERT_EQ(single.contradict(one, Eigen::Vector3d(0.3, 0, 0)), Verdict::kOpen);
  EXPECT_EQ(after(4, single, other, Eigen::Vector3d(0.3, 0, 0)), Verdict::kTagWrong);
}

TEST(SingleTagRelocalisation, OfALostBodyTheOtherTagIsKept) {
  SingleTagRelocalisation single;
  single.begin(kSingleTag, std::nullopt, {0.02, 0.0, 0.0});
  EXPECT_TRUE(single.is_watched());
  EXPECT_EQ(single.tag_id(), kSingleTag);
  EXPECT_EQ(after(5, single, {8}, Eigen::Vector3d(0.3, 0, 0)), Verdict::kTagWrong);
  single.forget();
  EXPECT_FALSE(single.is_watched());
}

TEST(SingleTagRelocalisation, IsWrongWhenTheOtherTagGivesNoPosition) {
  SingleTagRelocalisation single;
  single.begin(kSingleTag, by_imu(), {0.02, 0.0, 0.0});
  EXPECT_EQ(after(5, single, {8}, std::nullopt), Verdict::kTagWrong);
}

}  // namespace
}  // namespace fiducap
