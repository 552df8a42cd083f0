#include "detection/sheet/tag_sheet.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
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

TEST(TagSheet, ReadsIdsAndRangesOnly) {
  EXPECT_THAT(parse_id_list("0-3,7").value(), ElementsAre(0, 1, 2, 3, 7));
  EXPECT_THAT(parse_id_list("5,3-6").value(), ElementsAre(5, 3, 4, 6));
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

/// The tags of a page, each an upright square of this size.
std::vector<int> read_tags(const cv::Mat& page, const TagSheetOrder& sheet, int dots_per_inch) {
  // pdftoppm rounds to a fraction of a dot, of 0.13 mm at most.
  constexpr double kPrinted_mm = 0.05;
  const double dots_per_mm = dots_per_inch / 25.4;
  const auto image = std::make_shared<GrayImage>();
  image->resize(page.cols, page.rows);
  page.copyTo(cv::Mat(page.rows, page.cols, CV_8UC1, image->pixels.data()));
  TagDetector detector({.family = sheet.family}, {});
  std::vector<int> ids;
  for (const TagSighting& tag : detector.detect(CameraFrame{0, Instant{}, image}).tags) {
    ids.push_back(tag.tag_id);
    const auto& [bottom_left, bottom_right, top_right, top_left] = tag.corners_px;
    for (const Eigen::Vector2d across : {bottom_right - bottom_left, top_right - top_left}) {
      EXPECT_NEAR(across.x() / dots_per_mm, sheet.size_mm, kPrinted_mm) << tag.tag_id;
      EXPECT_NEAR(across.y() / dots_per_mm, 0, kPrinted_mm) << tag.tag_id;
    }
    EXPECT_NEAR((bottom_left.y() - top_left.y()) / dots_per_mm, sheet.size_mm, kPrinted_mm);
  }
  return ids;
}

TEST_F(PrintedSheetTest, HasEveryTagOnceInItsSize) {
  for (const TagSheetOrder& sheet :
       {order({0, 586}, 160, "a4"), order(parse_id_list("0-11").value(), 40, "letter"),
        // Black outside of the border: a white ring is printed around it.
        order({1, 2, 3}, 50, "a4", "tagStandard41h12")}) {
    SCOPED_TRACE(sheet.size_mm);
    constexpr int kDotsPerInch = 300;
    const auto pages = drawn(sheet, kDotsPerInch);
    EXPECT_EQ(pages.size(), 2u);
    std::vector<int> ids;
    for (const cv::Mat& page : pages)
      std::ranges::copy(read_tags(page, sheet, kDotsPerInch), std::back_inserter(ids));
    EXPECT_THAT(ids, testing::UnorderedElementsAreArray(sheet.ids));
  }
}

TEST_F(PrintedSheetTest, HasTagsOfEveryFamily) {
  constexpr int kDotsPerInch = 200;
  for (const TagFamilyFacts& facts : tag_families()) {
    SCOPED_TRACE(facts.name);
    const TagFamily family = value_of(TagFamily::named(std::string(facts.name)));
    int last = family.ids() - 1;
    while (!family.has_pose(last)) --last;
    const TagSheetOrder sheet{std::string(facts.name), {0, last / 2, last}, 37, *paper_named("a4")};
    EXPECT_EQ(read_tags(drawn(sheet, kDotsPerInch).back(), sheet, kDotsPerInch), sheet.ids);
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
