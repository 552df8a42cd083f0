#include "detection/candidate_search.hpp"

#include <gtest/gtest.h>

#include "detection/tag_detector.hpp"
#include "drawn_tag.hpp"

namespace fiducap {
namespace {

using Why = TagCandidate::Why;

class CandidateSearchTest : public testing::Test {
 protected:
  std::vector<TagCandidate> candidates(std::span<const TagSighting> found = {}) {
    CandidateSearch search(tags_, detector_);
    std::vector<TagCandidate> out(3);  // is replaced
    search.search(image_, found, out);
    return out;
  }
  std::vector<TagSighting> found_tags() {
    CameraFrame frame;
    frame.image = std::make_shared<const GrayImage>(image_);
    return TagDetector(tags_, detector_).detect(frame).tags;
  }

  TagSetConfig tags_;
  DetectorConfig detector_;
  GrayImage image_ = white_wall();
};

TEST_F(CandidateSearchTest, AnEmptyWallHasNone) { EXPECT_TRUE(candidates().empty()); }

TEST_F(CandidateSearchTest, FoundTagsAndTheirBitsAreExcluded) {
  draw_tag(image_, 7, 100, 100, 20);
  const auto found = found_tags();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(candidates(found).empty());
}

TEST_F(CandidateSearchTest, AGoodTagOutsideOfTheSearchIsReported) {
  const int edge_px = draw_tag(image_, 7, 100, 100, 20);
  const auto all = candidates();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].why, Why::kUnsearched);
  EXPECT_EQ(all[0].tag_id, 7);
  const double side_px = (all[0].corners_px[1] - all[0].corners_px[0]).norm();
  EXPECT_NEAR(side_px, edge_px, 1.5);
}

TEST_F(CandidateSearchTest, AFaintTagIsReadWithALowMargin) {
  draw_tag(image_, 7, 100, 100, 20, 205, 220);
  const auto all = candidates();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].why, Why::kLowMargin);
  EXPECT_EQ(all[0].tag_id, 7);
  EXPECT_GT(all[0].decision_margin, 0);
  EXPECT_LT(all[0].decision_margin, detector_.min_decision_margin);
}

TEST_F(CandidateSearchTest, ADarkSquareIsUnreadTooSmallOrFaint) {
  draw_square(image_, 60, 60, 100, 30);
  draw_square(image_, 300, 60, 11, 30);
  draw_square(image_, 400, 60, 80, 205);
  const auto all = candidates();
  ASSERT_EQ(all.size(), 3u) << "the largest first";
  EXPECT_EQ(all[0].why, Why::kUnread);
  EXPECT_EQ(all[0].tag_id, -1);
  EXPECT_EQ(all[1].why, Why::kFaint);
  EXPECT_EQ(all[2].why, Why::kTooSmall);
}

TEST_F(CandidateSearchTest, ABrightSquareOnADarkWallIsNone) {
  image_ = white_wall(640, 480, 40);
  draw_square(image_, 60, 60, 100, 220);
  EXPECT_TRUE(candidates().empty());
}

TEST_F(CandidateSearchTest, ReturnsAtMostItsBoundForImagesOfAnySize) {
  for (int v = 10; v < 460; v += 25)
    for (int u = 10; u < 620; u += 25) draw_square(image_, u, v, 14, 30);
  EXPECT_EQ(candidates().size(), CandidateSearch::kMost);
  image_ = white_wall(3, 2);
  EXPECT_TRUE(candidates().empty());
}

}  // namespace
}  // namespace fiducap
