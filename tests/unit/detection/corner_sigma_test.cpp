#include "detection/corner_sigma.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "detection/observe.hpp"
#include "detection/tag_search.hpp"
#include "drawn_tag.hpp"
#include "support/corner_scenes.hpp"

namespace fiducap {
namespace {

TagSighting square(double side, double sharpness = 1.0) {
  TagSighting tag;
  tag.decision_margin = 100;
  tag.corners_px = {{{100, 100 + side}, {100 + side, 100 + side}, {100 + side, 100}, {100, 100}}};
  tag.sharpness = sharpness;
  tag.sides.fill({sharpness, 0});
  return tag;
}

TEST(CornerSigma, GrowsForSmallSlantedBlurredAndNoisyTags) {
  EXPECT_EQ(corner_sigma_px(square(50, 0), 2.0), 0.0) << "the source measured nothing";
  const double fine = corner_sigma_px(square(60), 1.0);
  EXPECT_NEAR(fine, 0.008, 0.001);
  EXPECT_GT(corner_sigma_px(square(12), 1.0), 1.8 * fine);
  EXPECT_GT(corner_sigma_px(square(60, 0.3), 1.0), 2 * fine);
  EXPECT_GT(corner_sigma_px(square(60), 15.0), 1.5 * fine);
  TagSighting thin = square(60);
  for (auto& px : thin.corners_px) px.x() = 100 + 0.25 * (px.x() - 100);
  EXPECT_GT(corner_sigma_px(thin, 1.0), 1.5 * fine);
}

TEST(CornerSigma, IsLargeForSidesBlurredClippedOrWithoutAFit) {
  TagSighting tag = square(60, 0.3);
  tag.sides[1].sharpness = tag.sides[3].sharpness = 1;  // along the motion
  auto sides = side_sigmas(tag, 3.0);
  EXPECT_GT(sides[0].shift_px, 2.5 * sides[1].shift_px);
  EXPECT_DOUBLE_EQ(sides[1].shift_px, sides[3].shift_px);
  // Blurred sides are shifted; sharp ones have the noise along them.
  EXPECT_LT(sides[1].shift_px / sides[1].turn_px, sides[0].shift_px / sides[0].turn_px);
  tag = square(60, 0.3);
  tag.sides[1].sharpness = 0;
  sides = side_sigmas(tag, 1.0);
  EXPECT_GT(sides[1].shift_px, 5 * sides[0].shift_px);
  tag.sides.fill({});
  EXPECT_EQ(side_sigmas(tag, 1.0)[1].shift_px, sides[0].shift_px)
      << "the source measured only the tag's sharpness";
  tag = square(60);
  const double fine = side_sigmas(tag, 1.0)[2].shift_px;
  tag.sides[2].clipped = 1;
  EXPECT_GT(side_sigmas(tag, 1.0)[2].shift_px, 0.3);
  EXPECT_EQ(side_sigmas(tag, 1.0)[1].shift_px, fine);
}

std::array<Eigen::Vector2d, 4> corners_between(double low, double high) {
  return {{{low, high}, {high, high}, {high, low}, {low, low}}};
}

TEST(TagSides, AreClippedByASaturatedWallIfTheQuietZoneIsNarrow) {
  for (const int cell : {2, 6}) {
    const auto clipped_by = [&](std::uint8_t wall) {
      GrayImage image = white_wall(200, 200, wall);
      draw_square(image, 61 - cell, 61 - cell, 10 * cell, 200);
      draw_square(image, 61, 61, 8 * cell, 40);
      return measure_sides(image, corners_between(60.5, 60.5 + 8 * cell))[0].clipped;
    };
    EXPECT_EQ(clipped_by(220), 0) << cell;
    EXPECT_EQ(clipped_by(255) > 0.5, cell == 2);
    EXPECT_TRUE(cell == 2 || clipped_by(255) == 0);
  }
}

TEST(CornerSigma, LastingErrorIsAddedToShiftsOfNarrowSides) {
  const auto sigmas = [](double side) {
    const TagSighting tag = square(side);
    const auto sides = side_sigmas(tag, 1.0);
    return std::pair(sides[0], with_lasting_error(sides, tag.corners_px)[0]);
  };
  const auto [wide, wide_lasting] = sigmas(60);
  EXPECT_EQ(wide.shift_px, wide_lasting.shift_px);
  const auto [narrow, narrow_lasting] = sigmas(16);
  EXPECT_NEAR(narrow_lasting.shift_px, std::hypot(narrow.shift_px, 0.05), 1e-9);
  EXPECT_EQ(narrow_lasting.turn_px, narrow.turn_px);
  EXPECT_EQ(with_lasting_error({}, square(16).corners_px)[0].shift_px, 0) << "nothing is known";
}

TEST(TagSides, HaveTheSharpnessOfTheirBlur) {
  // A black square from 60 to 140, blurred along u.
  const auto blurred = [](double blur) {
    GrayImage image = white_wall(200, 200, 200);
    const auto share = [&](int u, double edge) {
      return std::clamp((u - edge) / std::max(blur, 1e-6) + 0.5, 0.0, 1.0);
    };
    for (int v = 60; v < 140; ++v)
      for (int u = 0; u < 200; ++u)
        image.pixels[static_cast<std::size_t>(200 * v + u)] =
            static_cast<std::uint8_t>(std::lround(200 - 150 * (share(u, 59.5) - share(u, 139.5))));
    return image;
  };
  const auto sharpness = [&](double blur) {
    return least_sharpness(measure_sides(blurred(blur), corners_between(59.5, 139.5)));
  };
  constexpr double kRounding = 0.05;
  EXPECT_NEAR(sharpness(0), 1.0, kRounding);
  for (const double blur : {4.0, 6.0, 8.0}) EXPECT_NEAR(sharpness(blur), 2 / blur, kRounding);
  EXPECT_EQ(least_sharpness(measure_sides(blurred(8), corners_between(-9, -1))), 0.0)
      << "outside of the image";
}

/// (error / sigma)² of some errors.
struct ChiSquare {
  static constexpr double kGate = 16;  // 4 sigma: the gate of a filter
  double sum{}, sum_within{};
  int count{}, within{};
  void add(double value) {
    sum += value;
    ++count;
    if (value > kGate) return;
    sum_within += value;
    ++within;
  }
  [[nodiscard]] double mean() const { return sum / count; }
  [[nodiscard]] double mean_within() const { return sum_within / within; }
  [[nodiscard]] double share_beyond() const { return 1 - static_cast<double>(within) / count; }
};

constexpr unsigned kFirst = 20'000;  // the fit saw 1000 to 5199
constexpr double kOff_px = 1.0;      // beyond, not the noise of a line fit

/// Errors of the corners of a scene, raw pixels.
struct Found {
  TagSighting tag;
  std::array<Eigen::Vector2d, 4> corners_px;
  std::array<Eigen::Vector2d, 4> off_px;
  double pixel_noise;
  [[nodiscard]] double worst_px() const {
    double worst = 0;
    for (const auto& off : off_px) worst = std::max(worst, off.cwiseAbs().maxCoeff());
    return worst;
  }
};

/// Visits the tags found in scenes. @return number of gross errors, which are left out
template <typename Visit>
int over_scenes(unsigned scenes, bool upright, double light, double more_light, Visit visit) {
  TagSearch search({}, {});
  int gross = 0;
  for (unsigned k = 0; k < scenes; ++k) {
    const CornerScene scene = make_corner_scene(kFirst + k, light + more_light * k, upright);
    const CornerFrame& frame = search.search({0, instant_from_ns(k), scene.image}, scene.tags);
    for (const TagSighting& tag : frame.tags) {
      const auto truth = std::ranges::find(scene.tags, tag.tag_id, &ExpectedTag::tag_id);
      if (truth == scene.tags.end()) continue;
      Found found{tag, unbend_corners(scene.model, tag.corners_px), {}, frame.pixel_noise};
      for (std::size_t i = 0; i < 4; ++i)
        found.off_px[i] = found.corners_px[i] - truth->corners_px[i];
      if (found.worst_px() > kOff_px)
        ++gross;
      else
        visit(found, side_sigmas(tag, frame.pixel_noise));
    }
  }
  return gross;
}

/// Squared errors of a side in sigmas: shift and turn.
std::pair<double, double> side_squares(const Found& found, std::size_t i, const SideSigma& sigma) {
  const std::size_t next = (i + 1) % 4;
  const Eigen::Vector2d along = (found.corners_px[next] - found.corners_px[i]).normalized();
  const Eigen::Vector2d normal(-along.y(), along.x());
  const double one = normal.dot(found.off_px[i]);
  const double other = normal.dot(found.off_px[next]);
  return {std::pow(0.5 * (one + other) / sigma.shift_px, 2),
          std::pow(0.5 * (one - other) / sigma.turn_px, 2)};
}

TEST(CornerSigma, NormalisesErrorsOnImagesThatItWasNotFittedTo) {
  ChiSquare all, small, large, sharp, blurred, shift, turn, across, along;
  const auto add = [&](const Found& found, const std::array<SideSigma, 4>& sides) {
    const TagSighting& tag = found.tag;
    const double sigma = corner_sigma_px(tag, found.pixel_noise);
    ASSERT_GT(sigma, 0);
    double chi = 0;
    for (const auto& off : found.off_px) chi += off.squaredNorm() / (8 * sigma * sigma);
    all.add(chi);
    ((tag.corners_px[2] - tag.corners_px[0]).norm() < 40 ? small : large).add(chi);
    (tag.sharpness > 0.85 ? sharp : blurred).add(chi);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto [shifted, turned] = side_squares(found, i, sides[i]);
      shift.add(shifted);
      turn.add(turned);
      if (tag.sharpness > 0.6) continue;
      (tag.sides[i].sharpness > 1.5 * tag.sharpness ? along : across).add(0.5 * (shifted + turned));
    }
  };
  const int gross = over_scenes(220, false, 1, 0, add);
  ASSERT_GT(all.count, 700);
  EXPECT_LT(gross, all.count / 50);
  // 8 coordinates of some hundred tags, with tails heavier than a normal distribution's.
  EXPECT_NEAR(all.mean(), 1.0, 0.15);
  EXPECT_NEAR(small.mean(), 1.0, 0.25);
  EXPECT_NEAR(large.mean(), 1.0, 0.25);
  EXPECT_NEAR(sharp.mean(), 1.0, 0.25);
  EXPECT_NEAR(blurred.mean(), 1.0, 0.35);
  EXPECT_NEAR(shift.mean(), 1.0, 0.25);
  // A few turns beyond the gate are a fifth of the mean of all (1.22). A normal distribution has
  // 0.006 % there.
  EXPECT_NEAR(turn.mean_within(), 1.0, 0.2);
  EXPECT_LT(turn.share_beyond(), 0.015);
  // With one sigma per tag: 1.4, and 0.3.
  ASSERT_GT(along.count, 60);
  EXPECT_NEAR(across.mean(), 1.0, 0.35);
  EXPECT_NEAR(along.mean(), 1.0, 0.4);
}

TEST(CornerSigma, NormalisesErrorsOfSidesAlongTheGridOfPixels) {
  ChiSquare shift_small, shift_large, turn;
  over_scenes(220, true, 1, 0, [&](const Found& found, const std::array<SideSigma, 4>& sides) {
    const double cell_px = (found.corners_px[2] - found.corners_px[0]).norm() / 8 / M_SQRT2;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto along = (found.corners_px[(i + 1) % 4] - found.corners_px[i]).cwiseAbs();
      if (along.minCoeff() > 2 || found.tag.sides[i].sharpness < 0.95 || cell_px < 1.8) continue;
      const auto [shifted, turned] = side_squares(found, i, sides[i]);
      (cell_px < 4 ? shift_small : shift_large).add(shifted);
      turn.add(turned);
    }
  });
  ASSERT_GT(shift_small.count, 500);
  ASSERT_GT(shift_large.count, 500);
  EXPECT_NEAR(shift_small.mean_within(), 1.0, 0.2);
  EXPECT_NEAR(shift_large.mean_within(), 1.0, 0.2);
  EXPECT_NEAR(turn.mean_within(), 1.0, 0.2);
  EXPECT_LT(turn.share_beyond(), 0.01);
}

TEST(CornerSigma, NormalisesErrorsOfSaturatedPaperRoughly) {
  ChiSquare shift;
  over_scenes(60, false, 1.5, 0.1, [&](const Found& found, const std::array<SideSigma, 4>& sides) {
    for (std::size_t i = 0; i < 4; ++i)
      if (found.tag.sides[i].clipped > 0.9) shift.add(side_squares(found, i, sides[i]).first);
  });
  ASSERT_GT(shift.count, 200);
  EXPECT_GT(shift.mean(), 0.5);  // 100 without the term for clipping
  EXPECT_LT(shift.mean(), 2.0);
}

}  // namespace
}  // namespace fiducap
