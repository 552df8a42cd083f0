#include "detection/image_measures.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <set>

#include "detection/candidate_search.hpp"
#include "detection/tag_detector.hpp"
#include "drawn_tag.hpp"
#include "rendered_wall.hpp"

namespace fiducap {
namespace {

using Why = TagCandidate::Why;

// Steps between whole pixels, and a blur of whole pixels: the ellipse is not exact.
constexpr double kSmearTolerance_px = 1.5;

std::vector<TagSighting> tags_in(const GrayImage& image) {
  TagDetector detector({}, DetectorConfig{.min_decision_margin = 5});
  return detector.detect({0, {}, std::make_shared<const GrayImage>(image)}).tags;
}

TEST(ImageMeasures, DescribeTheExposure) {
  GrayImage image = white_wall(640, 480, 200);
  draw_square(image, 0, 0, 320, 30);
  ImageMeasures found = measure(image);
  EXPECT_EQ(found.black, 30);
  EXPECT_EQ(found.white, 200);
  const double dark = 320.0 * 320 / (640.0 * 480);
  EXPECT_NEAR(found.mean, 30 * dark + 200 * (1 - dark), 1.0);
  EXPECT_EQ(found.bright_share, 0);
  EXPECT_GT(found.histogram[30 / 4], 0u);
  EXPECT_GT(found.histogram[200 / 4], 0u);
  EXPECT_EQ(std::accumulate(found.histogram.begin(), found.histogram.end(), 0u),
            320u * 240 - 240 - 319);
  image = white_wall(640, 480, 255);
  draw_square(image, 0, 0, 240, 0);
  found = measure(image);
  EXPECT_NEAR(found.dark_share, 240.0 * 240 / (640.0 * 480), 0.01);
  EXPECT_NEAR(found.bright_share, 1 - found.dark_share, 0.001);
}

TEST(ImageMeasures, HaveASteepestEdgeOfOneInASharpImageOnly) {
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

TEST(ImageBlur, SeparatesMotionAndDefocus) {
  GrayImage sharp = white_wall();
  draw_tag(sharp, 7, 100, 100, 20);
  const ImageBlur none = blur_of(tags_in(sharp));
  ASSERT_EQ(none.tags, 1);
  EXPECT_NEAR(none.focus_px, 2, 0.5);
  EXPECT_LT(none.motion_px, kSmearTolerance_px);
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

/// Adds noise of the sensor after brightness and contrast are changed.
GrayImage noisy(GrayImage image, unsigned seed, double sigma, double light = 1, double offset = 0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, std::max(sigma, 1e-9));
  for (auto& px : image.pixels)
    px = static_cast<std::uint8_t>(
        std::clamp(std::lround(offset + light * px + noise(random)), 0L, 255L));
  return image;
}

GrayImage flat(int width, int height, std::uint8_t gray, double sigma) {
  return noisy(white_wall(width, height, gray), 1, sigma);
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
    const auto noise = pixel_noise(flat(752, 480, 120, sigma)).value();
    // Rounding to whole gray values adds a twelfth to the variance.
    const double truth = std::sqrt(sigma * sigma + 1.0 / 12);
    EXPECT_NEAR(noise, truth, kTolerance * truth) << sigma;
  }
}

TEST(PixelNoise, SkipsClippedPixelsAndIsUnknownWithoutOthers) {
  EXPECT_FALSE(pixel_noise(flat(752, 480, 255, 0)));
  EXPECT_FALSE(pixel_noise(flat(8, 480, 100, 3)));
  EXPECT_FALSE(pixel_noise({}));
  GrayImage half = flat(752, 480, 120, 3.0);
  std::fill(half.pixels.begin(), half.pixels.begin() + 752 * 240, std::uint8_t{255});
  const auto noise = pixel_noise(half).value();
  EXPECT_NEAR(noise, 3.0, 0.3);
}

TEST(ContrastAbove, FollowsTheNoiseWithinItsBounds) {
  DetectorConfig config;
  EXPECT_EQ(contrast_above(0.0, config), config.min_white_black_diff);
  EXPECT_EQ(contrast_above(3.0, config), 20);
  EXPECT_EQ(contrast_above(100.0, config), 25) << "margin 20 needs a contrast of about 40";
  config.min_white_black_diff = 40;
  EXPECT_EQ(contrast_above(1.0, config), 40) << "the configuration is the lower bound";
}

/// A threshold must not lose tags that a low one finds. A benchmark measures its time.
TEST(ContrastAbove, LosesNoTagInNoisyAndDarkImages) {
  const auto bright = RenderedWall(0.0).photograph();
  for (const double light : {1.0, 0.5, 0.3}) {
    for (const double sigma : {1.0, 2.0, 3.0, 4.0, 6.0}) {
      SCOPED_TRACE(testing::Message() << "light " << light << " noise " << sigma);
      const GrayImage image = noisy(*bright, 2, sigma, light, 10);
      const auto noise = pixel_noise(image).value();
      const auto wanted = ids_found(image, 5);
      const auto found = ids_found(image, contrast_above(noise, {}));
      EXPECT_TRUE(std::includes(found.begin(), found.end(), wanted.begin(), wanted.end()))
          << found.size() << " of " << wanted.size();
      EXPECT_TRUE(light * 180 <= 12 * sigma || wanted.size() == 6u) << "the scene shows nothing";
    }
  }
}

class CandidateSearchTest : public testing::Test {
 protected:
  std::vector<TagCandidate> candidates(std::span<const TagSighting> found = {}) {
    CandidateSearch search(tags_, detector_);
    std::vector<TagCandidate> out(3);  // is replaced
    search.search(image_, found, out);
    return out;
  }

  TagSetConfig tags_;
  DetectorConfig detector_;
  GrayImage image_ = white_wall();
};

TEST_F(CandidateSearchTest, FindsNoneOnAnEmptyWallAndInBrightSquares) {
  EXPECT_TRUE(candidates().empty());
  image_ = white_wall(640, 480, 40);
  draw_square(image_, 60, 60, 100, 220);
  EXPECT_TRUE(candidates().empty());
}

TEST_F(CandidateSearchTest, ReportsUnsearchedAndFaintTagsButNoneThatAreFound) {
  const int edge_px = draw_tag(image_, 7, 100, 100, 20);
  auto all = candidates();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].why, Why::kUnsearched);
  EXPECT_EQ(all[0].tag_id, 7);
  EXPECT_NEAR((all[0].corners_px[1] - all[0].corners_px[0]).norm(), edge_px, 1.5);
  const CameraFrame frame{0, {}, std::make_shared<const GrayImage>(image_)};
  EXPECT_TRUE(candidates(TagDetector(tags_, detector_).detect(frame).tags).empty()) << "found";
  draw_tag(image_, 7, 100, 100, 20, 205, 220);
  all = candidates();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].why, Why::kLowMargin);
  EXPECT_EQ(all[0].tag_id, 7);
  EXPECT_GT(all[0].decision_margin, 0);
  EXPECT_LT(all[0].decision_margin, detector_.min_decision_margin);
}

TEST_F(CandidateSearchTest, ReportsDarkSquaresAsUnreadTooSmallOrFaint) {
  draw_square(image_, 60, 60, 100, 30);
  draw_square(image_, 300, 60, 11, 30);
  draw_square(image_, 400, 60, 80, 205);
  const auto all = candidates();
  ASSERT_EQ(all.size(), 3u) << "the largest first";
  EXPECT_EQ(all[0].why, Why::kUnread);
  EXPECT_EQ(all[0].tag_id, -1);
  EXPECT_EQ(all[1].why, Why::kFaint);
  EXPECT_EQ(all[2].why, Why::kTooSmall);
}

TEST_F(CandidateSearchTest, ReturnsAtMostItsBoundForImagesOfAnySize) {
  for (int v = 10; v < 460; v += 25)
    for (int u = 10; u < 620; u += 25) draw_square(image_, u, v, 14, 30);
  EXPECT_EQ(candidates().size(), CandidateSearch::kMost);
  image_ = white_wall(3, 2);
  EXPECT_TRUE(candidates().empty());
}

}  // namespace
}  // namespace fiducap
