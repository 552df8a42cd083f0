#include "detection/no_tag.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "detection/other_families.hpp"
#include "rendered_wall.hpp"
#include "unit/detection/drawn_grid.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

/// A wall with six tags, photographed three times.
class NoTagTest : public testing::Test {
 protected:
  using Change = std::function<void(GrayImage&)>;

  std::string why(const Change& change, const TagSetConfig& tags = {}) {
    std::vector<SharedImage> images;
    for (std::uint64_t k = 0; k < 3; ++k) {
      GrayImage image = *wall_.photograph(k);
      change(image);
      images.push_back(std::make_shared<const GrayImage>(std::move(image)));
    }
    return why_no_tag(images, tags, {});
  }
  static void mirror(GrayImage& image) {
    for (auto row = image.pixels.begin(); row != image.pixels.end(); row += image.width)
      std::reverse(row, row + image.width);
  }
  static void invert(GrayImage& image) {
    for (auto& gray : image.pixels) gray = static_cast<std::uint8_t>(255 - gray);
  }
  static Change light(double gain, double offset = 0) {
    return [=](GrayImage& image) {
      for (auto& gray : image.pixels)
        gray = static_cast<std::uint8_t>(std::clamp(gain * gray + offset, 0.0, 255.0));
    };
  }
  static void nothing(GrayImage&) {}

  RenderedWall wall_;
};

TEST_F(NoTagTest, MirroredAndNegativeImagesAreNamed) {
  EXPECT_THAT(why(mirror),
              AllOf(StartsWith("the images are mirrored: 6 tags are found when they are flipped"),
                    HasSubstr("Switch the mirror off in the driver")));
  EXPECT_THAT(why([](GrayImage& image) { std::ranges::reverse(image.pixels), mirror(image); }),
              StartsWith("the images are mirrored: 6 tags"))
      << "top and bottom exchanged";
  EXPECT_THAT(why(invert), StartsWith("the images are negatives, or the tags are printed white on "
                                      "black: 6 tags are found"));
  EXPECT_THAT(why([](GrayImage& image) { mirror(image), invert(image); }),
              StartsWith("the images are mirrored, and black and white are exchanged: 6 tags"));
}

TEST_F(NoTagTest, LightIsNamedWithItsGrays) {
  EXPECT_THAT(why(light(0.06)), AllOf(StartsWith("the images are dark, their brightest pixels"),
                                      HasSubstr("6 tags are found with a decision margin of")));
  EXPECT_THAT(why([](GrayImage& image) { image = white_wall(376, 240, 5); }),
              StartsWith("the images are dark, their brightest pixels have gray 5 of 255"));
  EXPECT_THAT(why(light(0.05, 240)), StartsWith("the images are too bright"));
  EXPECT_THAT(why(light(0.1, 100)), StartsWith("the images have little contrast"));
}

TEST_F(NoTagTest, BlurIsNamedInPixels) {
  for (const int over_px : {15, 25})
    EXPECT_THAT(why([=](GrayImage& image) { blur(image, over_px, over_px); }),
                StartsWith("the images are blurred over"))
        << over_px;
  for (const std::pair<int, int> over_px : {std::pair(30, 1), std::pair(1, 30), std::pair(45, 1)})
    EXPECT_THAT(why([=](GrayImage& image) { blur(image, over_px.first, over_px.second); }),
                StartsWith("the images are blurred over"))
        << over_px.first;
}

TEST_F(NoTagTest, SmallTagsAreNamedInPixels) {
  wall_.X_WV = simulation::facing_camera(4.2);  // 10 px
  EXPECT_THAT(why(nothing),
              AllOf(HasSubstr("small"), HasSubstr("10 px wide"), HasSubstr("nearer")));
  wall_.X_WV = simulation::facing_camera(6.5);  // 7 px
  EXPECT_THAT(why(nothing), AllOf(HasSubstr("too small"), HasSubstr("px wide")));
}

TEST_F(NoTagTest, OtherFamiliesAreNamed) {
  EXPECT_THAT(why(nothing, {.family = "tag25h9"}),
              AllOf(StartsWith("the tags are tag36h11, not tag25h9 (6 tags are found)"),
                    HasSubstr("DICT_APRILTAG_36h11 if OpenCV")));
  EXPECT_THAT(why(mirror, {.family = "DICT_6X6_250"}),
              AllOf(StartsWith("the images are mirrored"),
                    HasSubstr("And the tags are tag36h11, not DICT_6X6_250")));
}

TEST_F(NoTagTest, KalibrsGridIsNamed) {
  const auto grid = [](GrayImage& image) {
    image = white_wall();
    DrawnGrid{}.draw(image, 100, 60);
    blur(image, 2, 2);
  };
  EXPECT_THAT(why(grid), AllOf(HasSubstr("Kalibr's AprilGrid"), HasSubstr("36 tags are found")));
}

TEST_F(NoTagTest, TagsOfTheFamilyAreNoReason) {
  EXPECT_THAT(why(nothing, {.ignore = {0, 1, 2, 3, 4, 5}}),
              HasSubstr("tags.ignore lists all of them"));
  EXPECT_THAT(why([](GrayImage& image) { image = white_wall(); }),
              Not(HasSubstr("tags are found")));
  EXPECT_EQ(why_no_tag({}, {}, {}), "");
}

TEST_F(NoTagTest, AnEmptyRoomLooksLikeNoTag) {
  wall_.tags.clear();
  const std::string text = why(nothing);
  EXPECT_THAT(text, Not(HasSubstr("are found"))) << text;
  EXPECT_THAT(why(nothing, {.family = "DICT_4X4_50"}), Not(HasSubstr("are found")));
}

TEST_F(NoTagTest, OtherFamilyInTakesMoreTagsThanOfTheConfiguredOne) {
  const std::vector<SharedImage> images{wall_.photograph(0), wall_.photograph(1)};
  EXPECT_EQ(other_family_in(images, {}), "");
  EXPECT_THAT(other_family_in(images, {.family = "tag16h5"}), HasSubstr("tag36h11, not tag16h5"));
}

TEST(NoTagAdvice, IsGivenOnceAfterManyImagesWithoutATag) {
  NoTagAdvice advice(TagSetConfig{});
  const auto image = std::make_shared<const GrayImage>(white_wall(64, 48));
  for (int i = 1; i < NoTagAdvice::kImages; ++i) advice.note(image, false);
  EXPECT_EQ(advice.why(), "");
  advice.note(image, false);
  EXPECT_NE(advice.why(), "");
  advice.note(image, true);
  EXPECT_EQ(advice.why(), "");
}

TEST(HalfTurnedFamily, IsOpenCvsPrint) {
  EXPECT_EQ(half_turned_family("tag36h11"), "DICT_APRILTAG_36h11");
  EXPECT_EQ(half_turned_family("DICT_APRILTAG_25h9"), "tag25h9");
  EXPECT_EQ(half_turned_family("tagCircle21h7"), "");
  EXPECT_EQ(half_turned_family("DICT_4X4_50"), "");
}

/// One image with three tags of each family.
TEST(AnyFamilyDetector, ReadsEveryFamily) {
  AnyFamilyDetector detector;
  for (const TagFamilyFacts& facts : tag_families()) {
    const TagFamily family = TagFamily::named(std::string(facts.name)).value();
    constexpr int kCell_px = 6;
    GrayImage image = white_wall();
    for (int i = 0; i < 3; ++i) {
      const auto cells = family.cells(i + 1);
      for (int k = 0; k < family.width() * family.width(); ++k)
        draw_square(image, 40 + 190 * i + k % family.width() * kCell_px,
                    100 + k / family.width() * kCell_px, kCell_px,
                    cells[static_cast<std::size_t>(k)] == 0 ? 20 : 220);
    }
    std::vector<FamilySighting> found;
    detector.detect(image, {}, found);
    EXPECT_EQ(std::ranges::count(found, &*find_tag_family(facts.name), &FamilySighting::family), 3)
        << facts.name;
  }
}

TEST(FewImages, AreSpreadEvenly) {
  FewImages few;
  std::vector<SharedImage> all;
  for (int i = 0; i < 1000; ++i) {
    auto image = std::make_shared<GrayImage>();
    image->width = i;
    all.push_back(image);
    few.note(all.back());
    ASSERT_LE(few.images().size(), 6u);
  }
  ASSERT_GE(few.images().size(), 3u);
  EXPECT_EQ(few.images().front()->width, 0);
  EXPECT_GT(few.images().back()->width, 600);
  for (std::size_t i = 2; i < few.images().size(); ++i)
    EXPECT_EQ(few.images()[i]->width - few.images()[i - 1]->width,
              few.images()[1]->width - few.images()[0]->width);
}

}  // namespace
}  // namespace fiducap
