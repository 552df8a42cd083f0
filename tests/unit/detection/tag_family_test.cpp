#include "detection/tag_family.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <set>
#if __has_include(<opencv2/objdetect/aruco_detector.hpp>)
#include <opencv2/objdetect/aruco_detector.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

#include "detection/tag_detector.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// A printed tag before a camera that looks at it from the front: every pixel is the mean over its
/// area, nothing is blurred and nothing noisy.
struct PrintedTag {
  // Multiples of a quarter of a pixel, the resolution of the average.
  double cell_px{9.25};
  Eigen::Vector2d offset_px{0.25, 0.5};  ///< Of the paper's upper-left corner, in its pixel.
  int quarter_turns{0};                  ///< Of the print, clockwise.
  bool mirrored{false};
};

/// White paper around the print, cells.
constexpr int kPaper = 2;

/// Row and column of the print that lie at this place of the turned one, in its cells.
Eigen::Vector2d place_in_print(Eigen::Vector2d at, int width, const PrintedTag& tag) {
  for (int k = 0; k < tag.quarter_turns; ++k) at = {at.y(), width - at.x()};
  if (tag.mirrored) at.x() = width - at.x();
  return at;
}

std::shared_ptr<const GrayImage> photograph(const TagFamily& family, int id,
                                            const PrintedTag& tag) {
  constexpr int kFine = 4;  // places of a pixel, along both of its sides
  const std::vector<std::uint8_t> cells = family.cells(id);
  const int width = family.width();
  const auto image = std::make_shared<GrayImage>();
  const int size = static_cast<int>(std::ceil((width + 2 * kPaper) * tag.cell_px)) + 1;
  image->resize(size, size);
  const auto gray_at = [&](const Eigen::Vector2d& px) {
    const Eigen::Vector2d turned =
        (px - tag.offset_px) / tag.cell_px - Eigen::Vector2d::Constant(kPaper);
    const Eigen::Vector2d at = place_in_print(turned, width, tag);
    if (at.minCoeff() < 0 || at.maxCoeff() >= width) return 220.0;
    const auto cell =
        static_cast<std::size_t>(static_cast<int>(at.y()) * width + static_cast<int>(at.x()));
    return cells[cell] != 0 ? 220.0 : 30.0;
  };
  for (int k = 0; k < size * size; ++k) {
    double sum = 0;
    for (int fine = 0; fine < kFine * kFine; ++fine) {
      const Eigen::Vector2d within(fine % kFine + 0.5, fine / kFine + 0.5);
      sum += gray_at(Eigen::Vector2d(k % size, k / size) + within / kFine);
    }
    image->pixels[static_cast<std::size_t>(k)] =
        static_cast<std::uint8_t>(std::lround(sum / (kFine * kFine)));
  }
  return image;
}

/// Bottom-left, bottom-right, top-right, top-left of the print, where they are in the image.
std::array<Eigen::Vector2d, 4> corners_of(const TagFamily& family, const PrintedTag& tag) {
  constexpr double kEdgeToCentre_px = 0.5;
  const double low = 0.5 * (family.width() - family.edge_width());
  const double high = low + family.edge_width();
  std::array<Eigen::Vector2d, 4> corners{{{low, high}, {high, high}, {high, low}, {low, low}}};
  for (Eigen::Vector2d& at : corners) {
    for (int k = 0; k < tag.quarter_turns; ++k) at = {family.width() - at.y(), at.x()};
    at = (at + Eigen::Vector2d::Constant(kPaper)) * tag.cell_px + tag.offset_px -
         Eigen::Vector2d::Constant(kEdgeToCentre_px);
  }
  return corners;
}

constexpr int kSampled = 6;
/// Grays are rounded, which leaves three thousandths of a pixel.
constexpr double kCorner_px = 0.01;

/// Of all sizes: the first, the last and some between.
std::set<int> sampled_ids(const TagFamily& family) {
  std::set<int> ids;
  for (int k = 0; k < kSampled; ++k)
    ids.insert(static_cast<int>(std::int64_t{k} * (family.ids() - 1) / (kSampled - 1)));
  std::erase_if(ids, [&](int id) { return !family.has_pose(id); });
  return ids;
}

std::vector<TagSighting> read(TagDetector& detector, std::shared_ptr<const GrayImage> image) {
  return detector.detect(CameraFrame{0, Instant{}, std::move(image)}).tags;
}

void expect_read(TagDetector& detector, const TagFamily& family, int id, const PrintedTag& tag) {
  SCOPED_TRACE(std::string(family.facts().name) + " id " + std::to_string(id) + ", turned " +
               std::to_string(tag.quarter_turns));
  const auto tags = read(detector, photograph(family, id, tag));
  ASSERT_EQ(tags.size(), 1u);
  EXPECT_EQ(tags[0].tag_id, id);
  EXPECT_EQ(tags[0].hamming, 0);
  const auto truth = corners_of(family, tag);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT((tags[0].corners_px[i] - truth[i]).norm(), kCorner_px) << "corner " << i;
  for (const TagSide& side : tags[0].sides) EXPECT_GT(side.sharpness, 0.9);
}

TEST(TagFamily, IsReadInAllFourRotations) {
  for (const TagFamilyFacts& facts : tag_families()) {
    const std::string name(facts.name);
    const auto family = TagFamily::named(name);
    ASSERT_TRUE(family) << name;
    EXPECT_EQ(family->edge_width(), facts.edge_cells) << name;
    TagDetector detector({.family = name}, {});
    PrintedTag tag;
    for (const int id : sampled_ids(*family)) {
      for (tag.quarter_turns = 0; tag.quarter_turns < 4; ++tag.quarter_turns)
        expect_read(detector, *family, id, tag);
      tag.offset_px += Eigen::Vector2d(0.25, 0.75);
    }
  }
}

/// Families of few bits in which some prints are mirror images of others.
bool has_mirror_images(std::string_view family) {
  return family.starts_with("DICT_4X4") || family == "DICT_ARUCO_ORIGINAL";
}

TEST(TagFamily, IsNotReadMirroredIfItHasEnoughBits) {
  for (const TagFamilyFacts& facts : tag_families()) {
    if (has_mirror_images(facts.name)) continue;
    const auto family = TagFamily::named(std::string(facts.name));
    TagDetector detector({.family = std::string(facts.name)}, {});
    for (const int id : sampled_ids(*family))
      EXPECT_TRUE(read(detector, photograph(*family, id, {.mirrored = true})).empty())
          << facts.name << " id " << id;
  }
}

TEST(TagFamily, HasNoPoseForAPrintWithRotationalSymmetry) {
  int found = 0;
  for (const TagFamilyFacts& facts : tag_families()) {
    const auto family = TagFamily::named(std::string(facts.name));
    for (int id = 0; id < family->ids(); ++id) {
      if (family->has_pose(id)) continue;
      ++found;
      EXPECT_EQ(facts.name, "DICT_ARUCO_ORIGINAL");
      EXPECT_THAT(family->fault_of(id), HasSubstr("looks the same when rotated"));
    }
  }
  EXPECT_EQ(found, 1);
}

TEST(TagFamily, NamesItsIdsAndRefusesUnknownNamesWithASuggestion) {
  const auto family = TagFamily::named("tag16h5");
  EXPECT_EQ(family->fault_of(29), "");
  EXPECT_EQ(family->fault_of(30), "tag16h5 has the ids 0 to 29");
  EXPECT_NE(family->fault_of(-1), "");
  EXPECT_THAT(error_of(TagFamily::named("tag36h1")),
              AllOf(HasSubstr("tag36h11, tag36h10"), HasSubstr("did you mean tag36h1")));
  EXPECT_THAT(tag_family_rule("DICT_4X5_50"), HasSubstr("did you mean DICT_4X4_50?"));
  EXPECT_FALSE(is_tag_family("tag99"));
  EXPECT_TRUE(is_tag_family("tag36h11"));
}

TEST(TagFamily, IsFoundByAnyOfItsSpellings) {
  for (const char* name : {"DICT_4X4_50", "dict_4x4_50", "aruco_4x4_50", "ArUco 4x4-50", "4x4_50",
                           "DICT_ARUCO_4X4_50"})
    EXPECT_EQ(listed_tag_family(name), "DICT_4X4_50") << name;
  EXPECT_EQ(listed_tag_family("TAG36H11"), "tag36h11");
  EXPECT_EQ(listed_tag_family("aruco_original"), "DICT_ARUCO_ORIGINAL");
  for (const char* name : {"36h11", "AprilTag 36h11", "apriltag_36h11", "kAprilTag36h11",
                           "kTag36h11", "tf36h11", "t36h11", "apriltag3_36h11_classic"})
    EXPECT_EQ(listed_tag_family(name), "tag36h11") << name;
  for (const char* name : {"Standard41h12", "tfStandard41h12", "41h12", "apriltag3_41h12_standard"})
    EXPECT_EQ(listed_tag_family(name), "tagStandard41h12") << name;
  for (const char* name : {"DICT_APRILTAG_36H11", "aruco_apriltag_36h11"})
    EXPECT_EQ(listed_tag_family(name), "DICT_APRILTAG_36h11") << name;
  EXPECT_FALSE(is_tag_family("apriltag_136h11"));
  EXPECT_EQ(listed_tag_family("Tag99"), "Tag99");
}

TEST(TagFamily, HasAWarningForFewBits) {
  for (const char* name : {"tag16h5", "DICT_4X4_50", "DICT_4X4_1000", "DICT_ARUCO_ORIGINAL"})
    EXPECT_THAT(tag_family_warning(name), HasSubstr("prefer tag36h11")) << name;
  for (const char* name : {"tag36h11", "tag25h9", "tagStandard41h12", "DICT_6X6_250"})
    EXPECT_EQ(tag_family_warning(name), "") << name;
}

constexpr std::array kSampledIds{0, 1, 7, 17, 23, 29};
/// OpenCV's corners are on whole pixels unless they are refined.
constexpr double kOpenCvCorner_px = 1.5;

void read_by_opencv(const cv::Mat& image, int dictionary,
                    std::vector<std::vector<cv::Point2f>>& corners, std::vector<int>& ids) {
  const auto markers = cv::aruco::getPredefinedDictionary(dictionary);
#if __has_include(<opencv2/objdetect/aruco_detector.hpp>)
  cv::aruco::ArucoDetector(markers).detectMarkers(image, corners, ids);
#else
  cv::aruco::detectMarkers(image, markers, corners, ids);
#endif
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
    EXPECT_LT((found.tags[0].corners_px[i] - as_opencv_prints[i]).norm(), kCorner_px) << i;
}

}  // namespace
}  // namespace fiducap
