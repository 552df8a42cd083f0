#include "detection/sheet/tag_sheet.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagStandard41h12.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "base/whole_file.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TagSheetOrder order(std::vector<int> ids, double size_mm, const char* paper,
                    const char* family = "tag36h11") {
  return {family, std::move(ids), size_mm, *paper_named(paper)};
}

TEST(TagSheet, ReadsIdsAndRanges) {
  EXPECT_THAT(parse_id_list("0-3,7").value(), ElementsAre(0, 1, 2, 3, 7));
  EXPECT_THAT(parse_id_list("5,3-6").value(), ElementsAre(5, 3, 4, 6));
}

TEST(TagSheet, RefusesWhatIsNoIdList) {
  for (const char* text :
       {"", "a", "1-", "-1", "3-1", "1,,2", "1;2", "0-99999", "1 2", "99999999999"})
    EXPECT_FALSE(parse_id_list(text)) << text;
}

TEST(TagSheet, NamesTheLargestSizeThatFits) {
  EXPECT_TRUE(tag_sheet_pdf(order({0}, 160, "a4")));
  EXPECT_TRUE(tag_sheet_pdf(order({0}, 160, "letter")));
  const auto sheet = tag_sheet_pdf(order({0}, 200, "a4"));
  ASSERT_FALSE(sheet);
  EXPECT_THAT(sheet.error().what, HasSubstr("up to 161 mm fit"));
}

TEST(TagSheet, RefusesIdsAndFamiliesThatDoNotExist) {
  EXPECT_THAT(tag_sheet_pdf(order({587}, 100, "a4")).error().what, HasSubstr("0 to 586"));
  EXPECT_THAT(tag_sheet_pdf(order({0}, 100, "a4", "tag99")).error().what, HasSubstr("tag36h11"));
  EXPECT_FALSE(tag_sheet_pdf(order({0}, std::nan(""), "a4")));
}

TEST(TagSheet, StubNamesEveryIdWithItsSize) {
  const std::string stub = tag_sheet_yaml(order({3, 11}, 62.5, "a4"));
  EXPECT_THAT(stub, HasSubstr("family: tag36h11\n"));
  EXPECT_THAT(stub, HasSubstr("size_m: 0.0625"));
  EXPECT_THAT(stub, HasSubstr("    3: 0.0625\n    11: 0.0625\n"));
}

// ---- Printed: pdftoppm draws the pages, libapriltag detects the tags.

constexpr double kDotsPerMm = 300 / 25.4;
// The corner estimate of libapriltag is good to about a tenth of a dot of 0.085 mm; the print must
// be within this.
constexpr double kSize_mm = 0.1;

struct Printed {
  int id{};
  std::array<cv::Point2d, 4> corners;  ///< Bottom-left, bottom-right, top-right, top-left, dots.
};

std::vector<Printed> read_tags(const cv::Mat& page, apriltag_family_t* family) {
  const std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)> detector(
      apriltag_detector_create(), apriltag_detector_destroy);
  apriltag_detector_add_family_bits(detector.get(), family, 1);
  detector->quad_decimate = 1;
  image_u8_t image{page.cols, page.rows, static_cast<int32_t>(page.step), page.data};
  const std::unique_ptr<zarray_t, void (*)(zarray_t*)> found(
      apriltag_detector_detect(detector.get(), &image), apriltag_detections_destroy);
  std::vector<Printed> tags;
  for (int i = 0; i < zarray_size(found.get()); ++i) {
    apriltag_detection_t* tag = nullptr;
    zarray_get(found.get(), i, &tag);
    Printed printed{tag->id, {}};
    for (std::size_t c = 0; c < 4; ++c) printed.corners[c] = {tag->p[c][0], tag->p[c][1]};
    tags.push_back(printed);
  }
  apriltag_detector_remove_family(detector.get(), family);
  return tags;
}

void expect_upright_square(const Printed& tag, double size_mm) {
  const auto& [bottom_left, bottom_right, top_right, top_left] = tag.corners;
  EXPECT_LT(bottom_left.x, bottom_right.x);
  EXPECT_GT(bottom_left.y, top_left.y);
  for (std::size_t c = 0; c < 4; ++c) {
    const cv::Point2d side = tag.corners[(c + 1) % 4] - tag.corners[c];
    EXPECT_NEAR(std::hypot(side.x, side.y) / kDotsPerMm, size_mm, kSize_mm) << "id " << tag.id;
  }
}

void expect_printed(const TagSheetOrder& sheet, apriltag_family_t* family, int pages) {
  if (std::system("command -v pdftoppm >/dev/null 2>&1") != 0)
    GTEST_SKIP()
        << "pdftoppm (package poppler-utils) is not here: the printed sizes were not measured";
  const TemporaryFolder folder;
  ASSERT_TRUE(write_whole_file(folder.file("tags.pdf"), tag_sheet_pdf(sheet).value()));
  ASSERT_EQ(std::system(("pdftoppm -gray -r 300 '" + folder.file("tags.pdf") + "' '" +
                         folder.file("p") + "'")
                            .c_str()),
            0);
  std::map<int, int> times_seen;
  int images = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.file(""))) {
    if (entry.path().extension() != ".pgm") continue;
    ++images;
    for (const Printed& tag :
         read_tags(cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE), family)) {
      ++times_seen[tag.id];
      expect_upright_square(tag, sheet.size_mm);
    }
  }
  EXPECT_EQ(images, pages);
  for (const int id : sheet.ids) EXPECT_EQ(times_seen[id], 1) << "id " << id;
  EXPECT_EQ(times_seen.size(), sheet.ids.size());
}

TEST(TagSheet, LargePrintedTagsHaveTheirSize) {
  apriltag_family_t* family = tag36h11_create();
  expect_printed(order({0, 586}, 160, "a4"), family, 2);
  tag36h11_destroy(family);
}

TEST(TagSheet, SmallPrintedTagsHaveTheirSize) {
  apriltag_family_t* family = tag36h11_create();
  expect_printed(order(parse_id_list("0-11").value(), 40, "letter"), family, 2);
  tag36h11_destroy(family);
}

TEST(TagSheet, FamiliesWithBlackOutsideGetAWhiteRing) {
  apriltag_family_t* family = tagStandard41h12_create();
  expect_printed(order({1, 2, 3}, 50, "a4", "tagStandard41h12"), family, 2);
  tagStandard41h12_destroy(family);
}

}  // namespace
}  // namespace fiducap
