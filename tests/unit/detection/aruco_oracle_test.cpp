// Our detector and OpenCV's, each on images drawn by the other one.
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#if __has_include(<opencv2/objdetect/aruco_detector.hpp>)
#include <opencv2/objdetect/aruco_detector.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

#include "detection/tag_detector.hpp"
#include "printed_tag.hpp"

namespace fiducap {
namespace {

constexpr int kCell_px = 10;
constexpr int kMargin_px = 20;
constexpr std::array kSampledIds{0, 1, 7, 17, 23, 29};
/// OpenCV's corners are on whole pixels unless they are refined.
constexpr double kOpenCvCorner_px = 1.5;
/// Grays are rounded, which leaves three thousandths of a pixel.
constexpr double kOurCorner_px = 0.01;

#if __has_include(<opencv2/objdetect/aruco_detector.hpp>)
cv::Mat drawn_by_opencv(int dictionary, int id, int side_px) {
  cv::Mat marker;
  cv::aruco::generateImageMarker(cv::aruco::getPredefinedDictionary(dictionary), id, side_px,
                                 marker);
  return marker;
}
void read_by_opencv(const cv::Mat& image, int dictionary,
                    std::vector<std::vector<cv::Point2f>>& corners, std::vector<int>& ids) {
  cv::aruco::ArucoDetector(cv::aruco::getPredefinedDictionary(dictionary))
      .detectMarkers(image, corners, ids);
}
#else
cv::Mat drawn_by_opencv(int dictionary, int id, int side_px) {
  cv::Mat marker;
  cv::aruco::drawMarker(cv::aruco::getPredefinedDictionary(dictionary), id, side_px, marker);
  return marker;
}
void read_by_opencv(const cv::Mat& image, int dictionary,
                    std::vector<std::vector<cv::Point2f>>& corners, std::vector<int>& ids) {
  cv::aruco::detectMarkers(image, cv::aruco::getPredefinedDictionary(dictionary), corners, ids);
}
#endif

TEST(ArucoOracle, DetectsTagsDrawnByOpenCv) {
  for (const TagFamilyFacts& facts : tag_families()) {
    if (facts.dictionary < 0) continue;
    TagDetector detector({.family = std::string(facts.name)}, {});
    const int side_px = facts.edge_cells * kCell_px;
    for (const int id : kSampledIds) {
      SCOPED_TRACE(std::string(facts.name) + " id " + std::to_string(id));
      const int size = side_px + 2 * kMargin_px;
      const auto image = std::make_shared<GrayImage>();
      image->resize(size, size);
      cv::Mat pixels(size, size, CV_8UC1, image->pixels.data());
      pixels.setTo(255);
      drawn_by_opencv(facts.dictionary, id, side_px)
          .copyTo(pixels(cv::Rect(kMargin_px, kMargin_px, side_px, side_px)));
      const auto found = detector.detect(CameraFrame{0, Instant{}, image});
      ASSERT_EQ(found.tags.size(), 1u);
      EXPECT_EQ(found.tags[0].tag_id, id);
      const double low = kMargin_px - 0.5;
      const double high = low + side_px;
      const std::array<Eigen::Vector2d, 4> truth{
          {{low, high}, {high, high}, {high, low}, {low, low}}};
      for (std::size_t i = 0; i < 4; ++i)
        EXPECT_LT((found.tags[0].corners_px[i] - truth[i]).norm(), kOurCorner_px) << i;
    }
  }
}

TEST(ArucoOracle, OpenCvDetectsPrintsInAllFourRotations) {
  for (const TagFamilyFacts& facts : tag_families()) {
    if (facts.dictionary < 0) continue;
    const auto family = TagFamily::named(std::string(facts.name));
    for (const int id : kSampledIds) {
      PrintedTag tag;
      for (tag.quarter_turns = 0; tag.quarter_turns < 4; ++tag.quarter_turns) {
        SCOPED_TRACE(std::string(facts.name) + " id " + std::to_string(id) + ", turned " +
                     std::to_string(tag.quarter_turns));
        const auto image = photograph(*family, id, tag);
        const cv::Mat pixels(image->height, image->width, CV_8UC1,
                             const_cast<std::uint8_t*>(image->pixels.data()));
        std::vector<std::vector<cv::Point2f>> corners;
        std::vector<int> ids;
        read_by_opencv(pixels, facts.dictionary, corners, ids);
        ASSERT_EQ(ids.size(), 1u);
        EXPECT_EQ(ids[0], id);
        const auto truth = corners_of(*family, tag);
        for (std::size_t i = 0; i < 4; ++i) {
          const cv::Point2f& theirs = corners[0][3 - i];  // clockwise from the top-left
          EXPECT_LT((Eigen::Vector2d(theirs.x, theirs.y) - truth[i]).norm(), kOpenCvCorner_px) << i;
        }
      }
    }
  }
}

TEST(ArucoOracle, OpenCvRotatesAprilTagsByHalfATurn) {
  const auto ours = TagFamily::named("tag36h11");
  TagDetector detector({.family = "DICT_APRILTAG_36h11"}, {});
  PrintedTag tag;
  tag.quarter_turns = 2;
  const auto found = detector.detect(CameraFrame{0, Instant{}, photograph(*ours, 5, tag)});
  ASSERT_EQ(found.tags.size(), 1u);
  EXPECT_EQ(found.tags[0].tag_id, 5);
  const auto as_opencv_prints = corners_of(*ours, PrintedTag{});
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT((found.tags[0].corners_px[i] - as_opencv_prints[i]).norm(), kOurCorner_px) << i;
}

}  // namespace
}  // namespace fiducap
