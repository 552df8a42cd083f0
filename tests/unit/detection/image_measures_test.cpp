#include "detection/image_measures.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <numeric>

#include "detection/tag_detector.hpp"
#include "drawn_tag.hpp"

namespace fiducap {
namespace {

// Steps between whole pixels, and a smear of whole pixels: the ellipse is not exact.
constexpr double kSmearTolerance_px = 1.5;

std::vector<TagSighting> tags_in(const GrayImage& image) {
  TagDetector detector({}, DetectorConfig{.min_decision_margin = 5});
  CameraFrame frame;
  frame.image = std::make_shared<const GrayImage>(image);
  return detector.detect(frame).tags;
}

TEST(ImageMeasures, TellHowAnImageIsExposed) {
  GrayImage image = white_wall(640, 480, 200);
  draw_square(image, 0, 0, 320, 30);
  const ImageMeasures found = measure(image);
  EXPECT_EQ(found.black, 30);
  EXPECT_EQ(found.white, 200);
  const double dark = 320.0 * 320 / (640.0 * 480);
  EXPECT_NEAR(found.mean, 30 * dark + 200 * (1 - dark), 1.0);
  EXPECT_EQ(found.bright_share, 0);
  EXPECT_GT(found.histogram[30 / 4], 0u);
  EXPECT_GT(found.histogram[200 / 4], 0u);
  EXPECT_EQ(std::accumulate(found.histogram.begin(), found.histogram.end(), 0u),
            320u * 240 - 240 - 319);
}

TEST(ImageMeasures, CountWhatIsAtTheEndsOfTheSensor) {
  GrayImage image = white_wall(640, 480, 255);
  draw_square(image, 0, 0, 240, 0);
  const ImageMeasures found = measure(image);
  EXPECT_NEAR(found.dark_share, 240.0 * 240 / (640.0 * 480), 0.01);
  EXPECT_NEAR(found.bright_share, 1 - found.dark_share, 0.001);
}

TEST(ImageMeasures, TheSteepestEdgeOfASharpImageIsNearOneAndOfASmearedOneIsNot) {
  GrayImage image = white_wall();
  draw_tag(image, 7, 100, 100, 20);
  EXPECT_GT(measure(image).steepest, 0.9);
  smear(image, 10, 10);
  EXPECT_LT(measure(image).steepest, 0.35);
  EXPECT_EQ(measure(white_wall()).steepest, 0) << "nothing to see";
}

TEST(ImageMeasures, TakeImagesOfAnySize) {
  EXPECT_EQ(measure({}).mean, 0);
  EXPECT_EQ(measure(white_wall(2, 2)).mean, 0);
  EXPECT_EQ(measure(white_wall(3, 3)).mean, 220);
}

TEST(ImageBlur, OfASharpTagIsTheLeastThereIs) {
  GrayImage image = white_wall();
  draw_tag(image, 7, 100, 100, 20);
  const ImageBlur found = blur_of(tags_in(image));
  ASSERT_EQ(found.tags, 1);
  EXPECT_NEAR(found.focus_px, 2, 0.5);
  EXPECT_LT(found.motion_px, kSmearTolerance_px);
}

TEST(ImageBlur, TellsMotionFromALensOutOfFocus) {
  GrayImage moved = white_wall();
  draw_tag(moved, 7, 100, 100, 24);
  GrayImage unfocused = moved;
  smear(moved, 9, 1);
  smear(unfocused, 7, 7);
  const ImageBlur motion = blur_of(tags_in(moved));
  ASSERT_EQ(motion.tags, 1);
  EXPECT_NEAR(motion.motion_px, 9, 2 * kSmearTolerance_px);
  EXPECT_NEAR(motion.motion_rad, 0, 0.1) << "to the right";
  EXPECT_LT(motion.focus_px, 2 + kSmearTolerance_px);
  const ImageBlur lens = blur_of(tags_in(unfocused));
  ASSERT_EQ(lens.tags, 1);
  EXPECT_GT(lens.focus_px, 5);
  EXPECT_LT(lens.motion_px, 2 * kSmearTolerance_px);
}

TEST(ImageBlur, KnowsNothingWithoutTagsOrOfSourcesThatDoNotSay) {
  EXPECT_EQ(blur_of({}).tags, 0);
  EXPECT_EQ(blur_of(std::vector<TagSighting>(3)).tags, 0);
}

}  // namespace
}  // namespace fiducap
