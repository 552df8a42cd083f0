#include "detection/pixel_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "detection/tag_detector.hpp"
#include "rendered_wall.hpp"

namespace fiducap {
namespace {

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

TEST(PixelNoise, PassesOverClippedPixelsAndSaysWhenNothingIsLeft) {
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

/// What a threshold may not do: lose tags that a low one finds. What it should do is a matter of
/// CPU, in the benchmark.
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
