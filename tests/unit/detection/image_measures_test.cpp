#include "detection/image_measures.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>
#include <set>

#include "detection/tag_detector.hpp"
#include "drawn_tag.hpp"
#include "rendered_wall.hpp"

namespace fiducap {
namespace {

// Steps between whole pixels, and a blur of whole pixels: the ellipse is not exact.
constexpr double kSmearTolerance_px = 1.5;

std::vector<TagSighting> tags_in(const GrayImage& image) {
  TagDetector detector({}, DetectorConfig{.min_decision_margin = 5});
  CameraFrame frame;
  frame.image = std::make_shared<const GrayImage>(image);
  return detector.detect(frame).tags;
}

TEST(ImageMeasures, DescribeTheExposure) {
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

TEST(ImageMeasures, CountBlackAndSaturatedPixels) {
  GrayImage image = white_wall(640, 480, 255);
  draw_square(image, 0, 0, 240, 0);
  const ImageMeasures found = measure(image);
  EXPECT_NEAR(found.dark_share, 240.0 * 240 / (640.0 * 480), 0.01);
  EXPECT_NEAR(found.bright_share, 1 - found.dark_share, 0.001);
}

TEST(ImageMeasures, TheSteepestEdgeIsNearOneInASharpImageOnly) {
  GrayImage image = white_wall();
  draw_tag(image, 7, 100, 100, 20);
  EXPECT_GT(measure(image).steepest, 0.9);
  blur(image, 10, 10);
  EXPECT_LT(measure(image).steepest, 0.35);
  EXPECT_EQ(measure(white_wall()).steepest, 0) << "nothing to see";
}

TEST(ImageMeasures, TakeImagesOfAnySize) {
  EXPECT_EQ(measure({}).mean, 0);
  EXPECT_EQ(measure(white_wall(2, 2)).mean, 0);
  EXPECT_EQ(measure(white_wall(3, 3)).mean, 220);
}

TEST(ImageBlur, IsMinimalForASharpTag) {
  GrayImage image = white_wall();
  draw_tag(image, 7, 100, 100, 20);
  const ImageBlur found = blur_of(tags_in(image));
  ASSERT_EQ(found.tags, 1);
  EXPECT_NEAR(found.focus_px, 2, 0.5);
  EXPECT_LT(found.motion_px, kSmearTolerance_px);
}

TEST(ImageBlur, SeparatesMotionAndDefocus) {
  GrayImage moved = white_wall();
  draw_tag(moved, 7, 100, 100, 24);
  GrayImage unfocused = moved;
  blur(moved, 9, 1);
  blur(unfocused, 7, 7);
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

TEST(ImageBlur, IsUnknownWithoutTagsOrSharpness) {
  EXPECT_EQ(blur_of({}).tags, 0);
  EXPECT_EQ(blur_of(std::vector<TagSighting>(3)).tags, 0);
}

GrayImage flat(int width, int height, double gray, double sigma) {
  GrayImage image;
  image.resize(width, height);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(gray, std::max(sigma, 1e-9));
  for (auto& px : image.pixels)
    px = static_cast<std::uint8_t>(std::clamp(std::lround(noise(random)), 0L, 255L));
  return image;
}

/// The image as a darker room would show it: contrast and brightness times `light`, then noise of
/// the sensor.
GrayImage in_the_dark(const GrayImage& bright, double light, double sigma) {
  GrayImage dark = bright;
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0, sigma);
  for (auto& px : dark.pixels)
    px = static_cast<std::uint8_t>(
        std::clamp(std::lround(10 + light * px + noise(random)), 0L, 255L));
  return dark;
}

std::set<int> ids_found(const GrayImage& image, int contrast) {
  TagDetector detector({}, {});
  std::vector<TagSighting> found;
  detector.detect(image, whole(image), {1.0, contrast}, found);
  std::set<int> ids;
  for (const TagSighting& tag : found) ids.insert(tag.tag_id);
  return ids;
}

TEST(PixelNoise, IsThatOfTheSensorOnAFlatImage) {
  constexpr double kTolerance = 0.06;  // of a quartile over some 6000 pixels: 2 %, three sigma
  for (const double sigma : {0.8, 1.5, 3.0, 6.0, 12.0}) {
    const auto noise = pixel_noise(flat(752, 480, 120, sigma));
    ASSERT_TRUE(noise);
    // Rounding to whole gray values adds a twelfth to the variance.
    const double truth = std::sqrt(sigma * sigma + 1.0 / 12);
    EXPECT_NEAR(*noise, truth, kTolerance * truth) << sigma;
  }
}

TEST(PixelNoise, IsThatOfTheSensorInARoomWithTagsAndTexture) {
  for (const double sigma : {1.0, 3.0, 6.0}) {
    const auto noise = pixel_noise(*RenderedWall(sigma).photograph());
    ASSERT_TRUE(noise);
    EXPECT_GT(*noise, 0.9 * sigma);
    EXPECT_LT(*noise, 1.35 * sigma) << "texture counts as noise";
  }
}

TEST(PixelNoise, SkipsClippedPixelsAndIsUnknownWithoutOthers) {
  EXPECT_FALSE(pixel_noise(flat(752, 480, 255, 0)));
  EXPECT_FALSE(pixel_noise(flat(8, 480, 100, 3)));
  EXPECT_FALSE(pixel_noise({}));
  GrayImage half = flat(752, 480, 120, 3.0);
  std::fill(half.pixels.begin(), half.pixels.begin() + 752 * 240, std::uint8_t{255});
  const auto noise = pixel_noise(half);
  ASSERT_TRUE(noise);
  EXPECT_NEAR(*noise, 3.0, 0.3);
}

TEST(ContrastAbove, FollowsTheNoiseBetweenTheConfiguredFloorAndTheDimmestUsefulTag) {
  DetectorConfig config;
  EXPECT_EQ(contrast_above(0.0, config), config.min_white_black_diff);
  EXPECT_EQ(contrast_above(3.0, config), 20);
  EXPECT_EQ(contrast_above(100.0, config), 25) << "margin 20 needs a contrast of about 40";
  config.min_white_black_diff = 40;
  EXPECT_EQ(contrast_above(1.0, config), 40) << "the configuration is the lower bound";
}

/// A threshold must not lose tags that a low one finds. Its effect on time is measured by the
/// benchmark.
TEST(ContrastAbove, LosesNoTagInNoisyAndDarkImages) {
  const auto bright = RenderedWall(0.0).photograph();
  for (const double light : {1.0, 0.5, 0.3}) {
    for (const double sigma : {1.0, 2.0, 3.0, 4.0, 6.0}) {
      const GrayImage image = in_the_dark(*bright, light, sigma);
      const auto noise = pixel_noise(image);
      ASSERT_TRUE(noise);
      const auto wanted = ids_found(image, 5);
      const auto found = ids_found(image, contrast_above(*noise, {}));
      EXPECT_TRUE(std::includes(found.begin(), found.end(), wanted.begin(), wanted.end()))
          << "light " << light << " noise " << sigma << ": " << found.size() << " of "
          << wanted.size();
      if (light * 180 > 12 * sigma) {
        EXPECT_EQ(wanted.size(), 6u)
            << "the scene shows nothing: light " << light << " noise " << sigma;
      }
    }
  }
}

}  // namespace
}  // namespace fiducap
