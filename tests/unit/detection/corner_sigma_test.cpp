#include "detection/corner_sigma.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "detection/side_bend.hpp"
#include "detection/tracking/tag_search.hpp"
#include "support/corner_scenes.hpp"

namespace fiducap {
namespace {

TagSighting square(double side, double sharpness = 1.0) {
  TagSighting tag;
  tag.decision_margin = 100;
  tag.corners_px = {{{100, 100 + side}, {100 + side, 100 + side}, {100 + side, 100}, {100, 100}}};
  tag.sharpness = sharpness;
  return tag;
}

TEST(CornerSigma, IsUnknownWhenTheSourceMeasuredNothing) {
  EXPECT_EQ(corner_sigma_px(square(50, 0), 2.0), 0.0);
}

TEST(CornerSigma, GrowsForSmallTiltedSmearedAndNoisyTags) {
  const double fine = corner_sigma_px(square(60), 1.0);
  EXPECT_NEAR(fine, 0.020, 0.002);
  EXPECT_GT(corner_sigma_px(square(12), 1.0), 1.8 * fine);
  EXPECT_GT(corner_sigma_px(square(60, 0.3), 1.0), 2 * fine);
  EXPECT_GT(corner_sigma_px(square(60), 15.0), 1.5 * fine);
  TagSighting thin = square(60);
  for (auto& px : thin.corners_px) px.x() = 100 + 0.25 * (px.x() - 100);
  EXPECT_GT(corner_sigma_px(thin, 1.0), 1.5 * fine);
}

TEST(EdgeSharpness, IsOneForASharpEdgeAndTheShareOfTwoPixelsForAMotion) {
  GrayImage image;
  image.resize(200, 200);
  const auto print = [&](double blur) {
    for (int v = 0; v < 200; ++v)
      for (int u = 0; u < 200; ++u) {
        // A black square from 60 to 140, smeared along u.
        const auto share = [&](double edge) {
          return std::clamp((u - edge) / std::max(blur, 1e-6) + 0.5, 0.0, 1.0);
        };
        const bool within = v >= 60 && v < 140;
        const double black = within ? share(59.5) - share(139.5) : 0.0;
        image.pixels[static_cast<std::size_t>(200 * v + u)] =
            static_cast<std::uint8_t>(std::lround(200 - 150 * black));
      }
  };
  const std::array<Eigen::Vector2d, 4> corners{
      {{59.5, 139.5}, {139.5, 139.5}, {139.5, 59.5}, {59.5, 59.5}}};
  constexpr double kRounding = 0.05;
  print(0);
  EXPECT_NEAR(edge_sharpness(image, corners), 1.0, kRounding);
  for (const double blur : {4.0, 6.0, 8.0}) {
    print(blur);
    EXPECT_NEAR(edge_sharpness(image, corners), 2 / blur, kRounding) << blur;
  }
  EXPECT_EQ(edge_sharpness(image, {{{-9, -1}, {-1, -1}, {-1, -9}, {-9, -9}}}), 0.0)
      << "nothing to measure";
}

/// Mean of (error / sigma)² over corners and coordinates.
struct ChiSquare {
  double sum{};
  int tags{};
  void add(double value) {
    sum += value;
    ++tags;
  }
  [[nodiscard]] double mean() const { return sum / tags; }
};

TEST(CornerSigma, MakesResidualsUnitOnImagesThatItWasNotFittedTo) {
  constexpr unsigned kFirst = 20'000;  // the fit saw 1000 to 2500
  constexpr unsigned kScenes = 220;
  constexpr double kOff_px = 1.0;  // what is further off is not the noise of a line fit
  ChiSquare all, small, large, sharp, smeared;
  int gross = 0;
  TagSearch search({}, {});
  for (unsigned k = 0; k < kScenes; ++k) {
    const CornerScene scene = make_corner_scene(kFirst + k);
    const CornerFrame& found = search.search({0, instant_from_ns(k), scene.image}, scene.tags);
    for (const TagSighting& tag : found.tags) {
      const auto truth = std::find_if(scene.tags.begin(), scene.tags.end(),
                                      [&](const ExpectedTag& t) { return t.tag_id == tag.tag_id; });
      if (truth == scene.tags.end()) continue;
      const auto corners = unbend_corners(scene.model, tag.corners_px);
      double squares = 0;
      double worst = 0;
      for (std::size_t i = 0; i < 4; ++i) {
        squares += (corners[i] - truth->corners_px[i]).squaredNorm() / 8;
        worst = std::max(worst, (corners[i] - truth->corners_px[i]).cwiseAbs().maxCoeff());
      }
      if (worst > kOff_px) {
        ++gross;
        continue;
      }
      const double sigma = corner_sigma_px(tag, found.pixel_noise);
      ASSERT_GT(sigma, 0);
      const double chi = squares / (sigma * sigma);
      all.add(chi);
      ((tag.corners_px[2] - tag.corners_px[0]).norm() < 40 ? small : large).add(chi);
      (tag.sharpness > 0.85 ? sharp : smeared).add(chi);
    }
  }
  ASSERT_GT(all.tags, 700);
  EXPECT_LT(gross, all.tags / 50);
  // 8 coordinates of some hundred tags, with tails heavier than a normal distribution's.
  EXPECT_NEAR(all.mean(), 1.0, 0.15);
  EXPECT_NEAR(small.mean(), 1.0, 0.25);
  EXPECT_NEAR(large.mean(), 1.0, 0.25);
  EXPECT_NEAR(sharp.mean(), 1.0, 0.25);
  EXPECT_NEAR(smeared.mean(), 1.0, 0.35);
}

}  // namespace
}  // namespace fiducap
