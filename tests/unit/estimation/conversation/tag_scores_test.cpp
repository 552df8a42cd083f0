#include <gtest/gtest.h>

#include "estimation/conversation/contradictions.hpp"

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

TEST_F(TagScoresTest, ATagThatContradictsTheOthersTenTimesIsGivenUp) {
  for (int i = 1; i < TagScores::kToDrop; ++i)
    EXPECT_TRUE(show({0, 1, 2}, {true, false, true}).empty()) << i;
  EXPECT_EQ(show({0, 1, 2}, {true, false, true}), std::vector<int>{1});
  EXPECT_TRUE(show({0, 1, 2}, {true, false, true}).empty()) << "it starts anew";
}

TEST_F(TagScoresTest, OneFitClearsATag) {
  for (int i = 1; i < TagScores::kToDrop; ++i) show({0, 1}, {true, false});
  show({0, 1}, {true, true});
  EXPECT_TRUE(show({0, 1}, {true, false}).empty());
}

TEST_F(TagScoresTest, AloneItIsGivenUpOnlyOnceAnotherFits) {
  for (int i = 0; i < 2 * TagScores::kToDrop; ++i) EXPECT_TRUE(show({1}, {false}).empty());
  EXPECT_TRUE(scores_.is_suspect(1));
  EXPECT_EQ(scores_.suspects(), 1);
  EXPECT_EQ(show({0}, {true}), std::vector<int>{1});
}

TEST_F(TagScoresTest, WhenAllContradictTheFilterMayBeWrong) {
  for (int i = 0; i < 2 * TagScores::kToDrop; ++i) show({1, 2}, {false, false});
  EXPECT_TRUE(show({0}, {true}).empty());
  EXPECT_EQ(scores_.suspects(), 0);
}

TEST(ContradictionsTest, CountsImagesInARow) {
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

}  // namespace
}  // namespace fiducap
