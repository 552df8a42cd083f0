// TagDetector finds the tags of `fiducap tags sheet`; pdftoppm draws the pages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "base/whole_file.hpp"
#include "detection/sheet/tag_sheet.hpp"
#include "detection/tag_detector.hpp"
#include "detection/tag_family.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

constexpr int kDotsPerInch = 200;
constexpr double kDotsPerMm = kDotsPerInch / 25.4;
constexpr double kSize_mm = 37;
/// pdftoppm rounds positions to a fraction of a dot of 0.13 mm.
constexpr double kPrinted_mm = 0.05;

std::shared_ptr<const GrayImage> drawn(const TagSheetOrder& sheet) {
  const TemporaryFolder folder;
  EXPECT_TRUE(write_whole_file(folder.file("tags.pdf"), tag_sheet_pdf(sheet).value()));
  const std::string draw = "pdftoppm -gray -r " + std::to_string(kDotsPerInch) + " '" +
                           folder.file("tags.pdf") + "' '" + folder.file("p") + "'";
  EXPECT_EQ(std::system(draw.c_str()), 0);
  const auto image = std::make_shared<GrayImage>();
  for (const auto& entry : std::filesystem::directory_iterator(folder.file(""))) {
    if (entry.path().extension() != ".pgm") continue;
    const cv::Mat page = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
    image->resize(page.cols, page.rows);
    page.copyTo(cv::Mat(page.rows, page.cols, CV_8UC1, image->pixels.data()));
  }
  return image;
}

void expect_upright(const TagSighting& tag) {
  const auto& [bottom_left, bottom_right, top_right, top_left] = tag.corners_px;
  for (const Eigen::Vector2d& across : {bottom_right - bottom_left, top_right - top_left}) {
    EXPECT_NEAR(across.x() / kDotsPerMm, kSize_mm, kPrinted_mm);
    EXPECT_NEAR(across.y() / kDotsPerMm, 0, kPrinted_mm);
  }
  EXPECT_NEAR((bottom_left.y() - top_left.y()) / kDotsPerMm, kSize_mm, kPrinted_mm);
}

TEST(TagSheetFamilies, EverySheetIsReadWithItsIdsAndSizes) {
  if (std::system("command -v pdftoppm >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "pdftoppm (package poppler-utils) is not here: no sheet was read";
  for (const TagFamilyFacts& facts : tag_families()) {
    const std::string name(facts.name);
    SCOPED_TRACE(name);
    int last = TagFamily::named(name)->ids() - 1;
    while (!TagFamily::named(name)->has_pose(last)) --last;
    const std::vector<int> ids{0, last / 2, last};
    TagDetector detector({.family = name}, {});
    const auto found = detector.detect(
        CameraFrame{0, Instant{}, drawn({name, ids, kSize_mm, *paper_named("a4")})});
    ASSERT_EQ(found.tags.size(), ids.size());
    for (std::size_t k = 0; k < ids.size(); ++k) {
      EXPECT_EQ(found.tags[k].tag_id, ids[k]);
      expect_upright(found.tags[k]);
    }
  }
}

TEST(TagSheetFamilies, AnIdWithoutAPoseIsNotPrinted) {
  const auto sheet = tag_sheet_pdf({"DICT_ARUCO_ORIGINAL", {1023}, kSize_mm, *paper_named("a4")});
  ASSERT_FALSE(sheet);
  EXPECT_THAT(sheet.error().what, HasSubstr("id 1023"));
  EXPECT_THAT(sheet.error().what, HasSubstr("use another id"));
}

}  // namespace
}  // namespace fiducap
