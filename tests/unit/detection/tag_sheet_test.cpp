#include "detection/sheet/tag_sheet.hpp"

#include <gmock/gmock.h>

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagStandard41h12.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "base/whole_file.hpp"
#include "detection/sheet/pdf_document.hpp"
#include "detection/tag_detector.hpp"
#include "detection/tag_family.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

TagSheetOrder order(std::vector<int> ids, double size_mm, const char* paper,
                    const char* family = "tag36h11") {
  return {family, std::move(ids), size_mm, *paper_named(paper)};
}

TEST(TagSheet, ReadsIdsAndRanges) {
  EXPECT_THAT(parse_id_list("0-3,7").value(), ElementsAre(0, 1, 2, 3, 7));
  EXPECT_THAT(parse_id_list("5,3-6").value(), ElementsAre(5, 3, 4, 6));
}

TEST(TagSheet, RefusesTextsThatAreNoIdList) {
  for (const char* text :
       {"", "a", "1-", "-1", "3-1", "1,,2", "1;2", "0-99999", "1 2", "99999999999"})
    EXPECT_FALSE(parse_id_list(text)) << text;
}

TEST(TagSheet, NamesTheLargestSizeThatFits) {
  EXPECT_TRUE(tag_sheet_pdf(order({0}, 160, "a4")));
  EXPECT_TRUE(tag_sheet_pdf(order({0}, 160, "letter")));
  EXPECT_THAT(error_of(tag_sheet_pdf(order({0}, 200, "a4"))), HasSubstr("up to 161 mm fit"));
}

TEST(TagSheet, RefusesInvalidIdsFamiliesAndSizes) {
  EXPECT_THAT(error_of(tag_sheet_pdf(order({587}, 100, "a4"))), HasSubstr("0 to 586"));
  EXPECT_THAT(error_of(tag_sheet_pdf(order({0}, 100, "a4", "tag99"))), HasSubstr("tag36h11"));
  EXPECT_FALSE(tag_sheet_pdf(order({0}, std::nan(""), "a4")));
  EXPECT_THAT(error_of(tag_sheet_pdf(order({1023}, 37, "a4", "DICT_ARUCO_ORIGINAL"))),
              AllOf(HasSubstr("id 1023"), HasSubstr("use another id")))
      << "it has no pose";
}

TEST(TagSheet, StubNamesEveryIdWithItsSize) {
  const std::string stub = tag_sheet_yaml(order({3, 11}, 62.5, "a4"));
  EXPECT_THAT(stub, HasSubstr("family: tag36h11\n"));
  EXPECT_THAT(stub, HasSubstr("size_m: 0.0625"));
  EXPECT_THAT(stub, HasSubstr("    3: 0.0625\n    11: 0.0625\n"));
}

// ---- Printed: pdftoppm draws the pages.

constexpr double kDotsPerMm = 300 / 25.4;
// The corner estimate of libapriltag is good to about a tenth of a dot of 0.085 mm.
constexpr double kSize_mm = 0.1;

class PrintedSheetTest : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v pdftoppm >/dev/null 2>&1") != 0)
      GTEST_SKIP() << "pdftoppm (package poppler-utils) is not here: no sheet was read";
  }
  static std::vector<cv::Mat> drawn(const TagSheetOrder& sheet, int dots_per_inch) {
    const TemporaryFolder folder;
    EXPECT_TRUE(write_whole_file(folder.file("tags.pdf"), tag_sheet_pdf(sheet).value()));
    const std::string draw = "pdftoppm -gray -r " + std::to_string(dots_per_inch) + " '" +
                             folder.file("tags.pdf") + "' '" + folder.file("p") + "'";
    EXPECT_EQ(std::system(draw.c_str()), 0);
    std::vector<cv::Mat> pages;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
      if (entry.path().extension() == ".pgm")
        pages.push_back(cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE));
    return pages;
  }
};

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

struct PrintCase {
  TagSheetOrder sheet;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

TEST_F(PrintedSheetTest, HasTagsOfTheirSizeByLibapriltag) {
  const PrintCase kCases[] = {
      {order({0, 586}, 160, "a4"), tag36h11_create, tag36h11_destroy},
      {order(parse_id_list("0-11").value(), 40, "letter"), tag36h11_create, tag36h11_destroy},
      // Black outside of the border: a white ring is printed around it.
      {order({1, 2, 3}, 50, "a4", "tagStandard41h12"), tagStandard41h12_create,
       tagStandard41h12_destroy}};
  for (const auto& [sheet, create, destroy] : kCases) {
    SCOPED_TRACE(sheet.size_mm);
    apriltag_family_t* family = create();
    std::map<int, int> times_seen;
    const auto pages = drawn(sheet, 300);
    EXPECT_EQ(pages.size(), 2u);
    for (const cv::Mat& page : pages) {
      for (const Printed& tag : read_tags(page, family)) {
        ++times_seen[tag.id];
        expect_upright_square(tag, sheet.size_mm);
      }
    }
    for (const int id : sheet.ids) EXPECT_EQ(times_seen[id], 1) << "id " << id;
    EXPECT_EQ(times_seen.size(), sheet.ids.size());
    destroy(family);
  }
}

TEST_F(PrintedSheetTest, HasTagsOfEveryFamilyByOurDetector) {
  constexpr int kDotsPerInch = 200;
  constexpr double kDots = kDotsPerInch / 25.4;  // per mm
  constexpr double kEdge_mm = 37;
  constexpr double kPrinted_mm = 0.05;  // pdftoppm rounds to a fraction of a dot of 0.13 mm
  for (const TagFamilyFacts& facts : tag_families()) {
    const std::string name(facts.name);
    SCOPED_TRACE(name);
    const TagFamily family = value_of(TagFamily::named(name));
    int last = family.ids() - 1;
    while (!family.has_pose(last)) --last;
    const std::vector<int> ids{0, last / 2, last};
    const cv::Mat page = drawn({name, ids, kEdge_mm, *paper_named("a4")}, kDotsPerInch).back();
    const auto image = std::make_shared<GrayImage>();
    image->resize(page.cols, page.rows);
    page.copyTo(cv::Mat(page.rows, page.cols, CV_8UC1, image->pixels.data()));
    TagDetector detector({.family = name}, {});
    const auto found = detector.detect(CameraFrame{0, Instant{}, image});
    ASSERT_EQ(found.tags.size(), ids.size());
    for (std::size_t k = 0; k < ids.size(); ++k) {
      EXPECT_EQ(found.tags[k].tag_id, ids[k]);
      const auto& [bottom_left, bottom_right, top_right, top_left] = found.tags[k].corners_px;
      for (const Eigen::Vector2d& across : {bottom_right - bottom_left, top_right - top_left}) {
        EXPECT_NEAR(across.x() / kDots, kEdge_mm, kPrinted_mm);
        EXPECT_NEAR(across.y() / kDots, 0, kPrinted_mm);
      }
      EXPECT_NEAR((bottom_left.y() - top_left.y()) / kDots, kEdge_mm, kPrinted_mm);
    }
  }
}

std::vector<PdfPage> two_pages() {
  std::vector<PdfPage> pages{{210, 297}, {25.4, 50.8}};
  pages[0].fill({{25.4, 50.8, 12.7, 6.35}});
  pages[0].text({10, 20}, 3, "a (b) \\ \xC3\xA9");
  pages[1].line({0, 0}, {25.4, 0}, 1);
  return pages;
}

TEST(PdfDocument, HasTheOffsetOfEachObjectInItsTable) {
  const std::string pdf = to_pdf(two_pages(), "t");
  const std::size_t table = std::strtoul(pdf.c_str() + pdf.find("startxref\n") + 10, nullptr, 10);
  ASSERT_EQ(pdf.compare(table, 9, "xref\n0 9\n"), 0) << pdf.substr(table, 20);
  const std::size_t first = table + 9;
  EXPECT_EQ(pdf.substr(first, 20), "0000000000 65535 f \n");
  for (std::size_t object = 1; object < 9; ++object) {
    const std::string entry = pdf.substr(first + 20 * object, 20);
    EXPECT_EQ(entry.substr(10), " 00000 n \n");
    const std::size_t offset = std::strtoul(entry.c_str(), nullptr, 10);
    const std::string begin = std::to_string(object) + " 0 obj\n";
    EXPECT_EQ(pdf.compare(offset, begin.size(), begin), 0) << "object " << object;
  }
}

TEST(PdfDocument, HasTheLengthOfEachStream) {
  const std::string pdf = to_pdf(two_pages(), "t");
  int streams = 0;
  for (std::size_t at = pdf.find("/Length "); at != std::string::npos;
       at = pdf.find("/Length ", at + 1), ++streams) {
    const std::size_t length = std::strtoul(pdf.c_str() + at + 8, nullptr, 10);
    const std::size_t begin = pdf.find("stream\n", at) + 7;
    EXPECT_EQ(pdf.compare(begin + length, 9, "endstream"), 0);
  }
  EXPECT_EQ(streams, 2);
}

TEST(PdfDocument, ConvertsMillimetresToPointsAndEscapesText) {
  const std::string page = two_pages()[0].content();
  EXPECT_THAT(page, HasSubstr("72.00000 144.00000 36.00000 18.00000 re\nf\n"));
  EXPECT_THAT(page, HasSubstr("(a \\(b\\) \\\\ ?\?) Tj"));
  EXPECT_THAT(to_pdf(two_pages(), "t"), HasSubstr("/MediaBox [ 0 0 72.00000 144.00000 ]"));
}

}  // namespace
}  // namespace fiducap
