#include "detection/corner_sigma.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "detection/observe.hpp"
#include "detection/tag_search.hpp"
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

TEST(CornerSigma, IsUnknownWhenTheSourceMeasuredNothing) {
  EXPECT_EQ(corner_sigma_px(square(50, 0), 2.0), 0.0);
}

TEST(CornerSigma, GrowsForSmallSlantedBlurredAndNoisyTags) {
  const double fine = corner_sigma_px(square(60), 1.0);
  EXPECT_NEAR(fine, 0.008, 0.001);
  EXPECT_GT(corner_sigma_px(square(12), 1.0), 1.8 * fine);
  EXPECT_GT(corner_sigma_px(square(60, 0.3), 1.0), 2 * fine);
  EXPECT_GT(corner_sigma_px(square(60), 15.0), 1.5 * fine);
  TagSighting thin = square(60);
  for (auto& px : thin.corners_px) px.x() = 100 + 0.25 * (px.x() - 100);
  EXPECT_GT(corner_sigma_px(thin, 1.0), 1.5 * fine);
}

TEST(CornerSigma, IsLargeOnlyForSidesAcrossTheMotion) {
  TagSighting tag = square(60, 0.3);
  tag.sides[1].sharpness = tag.sides[3].sharpness = 1;
  const auto sides = side_sigmas(tag, 3.0);
  EXPECT_GT(sides[0].shift_px, 2.5 * sides[1].shift_px);
  EXPECT_DOUBLE_EQ(sides[1].shift_px, sides[3].shift_px);
  // Blurred sides are shifted; sharp ones have the noise along them.
  EXPECT_LT(sides[1].shift_px / sides[1].turn_px, sides[0].shift_px / sides[0].turn_px);
}

TEST(CornerSigma, IsOnePixelForASideWithoutAFit) {
  TagSighting tag = square(60, 0.3);
  tag.sides[1].sharpness = 0;
  const auto sides = side_sigmas(tag, 1.0);
  EXPECT_GT(sides[1].shift_px, 5 * sides[0].shift_px);
  tag.sides.fill({});
  EXPECT_EQ(side_sigmas(tag, 1.0)[1].shift_px, sides[0].shift_px)
      << "the source knows only the tag's sharpness";
}

TEST(CornerSigma, GrowsForSaturatedPaper) {
  TagSighting tag = square(60);
  const double fine = side_sigmas(tag, 1.0)[2].shift_px;
  tag.sides[2].clipped = 1;
  EXPECT_GT(side_sigmas(tag, 1.0)[2].shift_px, 0.3);
  EXPECT_EQ(side_sigmas(tag, 1.0)[1].shift_px, fine);
}

/// A black square from 60.5 to 60.5 + side on its quiet zone, on a wall of this gray.
GrayImage black_square(int side, int quiet, std::uint8_t wall) {
  GrayImage image;
  image.resize(200, 200);
  const auto within = [&](int px, int more) { return px > 60 - more && px <= 60 + side + more; };
  for (int v = 0; v < 200; ++v)
    for (int u = 0; u < 200; ++u)
      image.pixels[static_cast<std::size_t>(200 * v + u)] = within(u, 0) && within(v, 0) ? 40
                                                            : within(u, quiet) && within(v, quiet)
                                                                ? 200
                                                                : wall;
  return image;
}

TEST(TagSides, ASaturatedWallClipsSidesWithNarrowQuietZones) {
  for (const int cell : {2, 6}) {
    const double low = 60.5;
    const double high = 60.5 + 8 * cell;
    const std::array<Eigen::Vector2d, 4> corners{
        {{low, high}, {high, high}, {high, low}, {low, low}}};
    const auto dull = measure_sides(black_square(8 * cell, cell, 220), corners);
    const auto glaring = measure_sides(black_square(8 * cell, cell, 255), corners);
    EXPECT_EQ(dull[0].clipped, 0) << cell;
    if (cell == 2) {
      EXPECT_GT(glaring[0].clipped, 0.5);
    } else {
      EXPECT_EQ(glaring[0].clipped, 0);
    }
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

TEST(TagSides, IsOneForASharpEdgeAndTheShareOfTwoPixelsForAMotion) {
  GrayImage image;
  image.resize(200, 200);
  const auto print = [&](double blur) {
    for (int v = 0; v < 200; ++v)
      for (int u = 0; u < 200; ++u) {
        // A black square from 60 to 140, blurred along u.
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
  EXPECT_NEAR(least_sharpness(measure_sides(image, corners)), 1.0, kRounding);
  for (const double blur : {4.0, 6.0, 8.0}) {
    print(blur);
    EXPECT_NEAR(least_sharpness(measure_sides(image, corners)), 2 / blur, kRounding) << blur;
  }
  EXPECT_EQ(least_sharpness(measure_sides(image, {{{-9, -1}, {-1, -1}, {-1, -9}, {-9, -9}}})), 0.0)
      << "nothing to measure";
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

std::vector<Found> find_in(TagSearch& search, const CornerScene& scene, unsigned k) {
  const CornerFrame& found = search.search({0, instant_from_ns(k), scene.image}, scene.tags);
  std::vector<Found> out;
  for (const TagSighting& tag : found.tags) {
    const auto truth = std::find_if(scene.tags.begin(), scene.tags.end(),
                                    [&](const ExpectedTag& t) { return t.tag_id == tag.tag_id; });
    if (truth == scene.tags.end()) continue;
    Found one{tag, unbend_corners(scene.model, tag.corners_px), {}, found.pixel_noise};
    for (std::size_t i = 0; i < 4; ++i) one.off_px[i] = one.corners_px[i] - truth->corners_px[i];
    out.push_back(one);
  }
  return out;
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

TEST(CornerSigma, MakesResidualsUnitOnImagesThatItWasNotFittedTo) {
  constexpr unsigned kScenes = 220;
  ChiSquare all, small, large, sharp, blurred, shift, turn, across, along;
  int gross = 0;
  TagSearch search({}, {});
  for (unsigned k = 0; k < kScenes; ++k) {
    for (const Found& found : find_in(search, make_corner_scene(kFirst + k), k)) {
      if (found.worst_px() > kOff_px) {
        ++gross;
        continue;
      }
      const TagSighting& tag = found.tag;
      const double sigma = corner_sigma_px(tag, found.pixel_noise);
      ASSERT_GT(sigma, 0);
      double chi = 0;
      for (const auto& off : found.off_px) chi += off.squaredNorm() / (8 * sigma * sigma);
      all.add(chi);
      ((tag.corners_px[2] - tag.corners_px[0]).norm() < 40 ? small : large).add(chi);
      (tag.sharpness > 0.85 ? sharp : blurred).add(chi);
      const auto sides = side_sigmas(tag, found.pixel_noise);
      for (std::size_t i = 0; i < 4; ++i) {
        const auto [shifted, turned] = side_squares(found, i, sides[i]);
        shift.add(shifted);
        turn.add(turned);
        if (tag.sharpness > 0.6) continue;
        (tag.sides[i].sharpness > 1.5 * tag.sharpness ? along : across)
            .add(0.5 * (shifted + turned));
      }
    }
  }
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

TEST(CornerSigma, IsRightForSidesAlongTheGridOfPixels) {
  constexpr unsigned kScenes = 220;
  ChiSquare shift_small, shift_large, turn;
  TagSearch search({}, {});
  for (unsigned k = 0; k < kScenes; ++k) {
    for (const Found& found : find_in(search, make_corner_scene(kFirst + k, 1.0, true), k)) {
      if (found.worst_px() > kOff_px) continue;
      const double cell_px = (found.corners_px[2] - found.corners_px[0]).norm() / 8 / M_SQRT2;
      const auto sides = side_sigmas(found.tag, found.pixel_noise);
      for (std::size_t i = 0; i < 4; ++i) {
        const auto along = (found.corners_px[(i + 1) % 4] - found.corners_px[i]).cwiseAbs();
        if (along.minCoeff() > 2 || found.tag.sides[i].sharpness < 0.95 || cell_px < 1.8) continue;
        const auto [shifted, turned] = side_squares(found, i, sides[i]);
        (cell_px < 4 ? shift_small : shift_large).add(shifted);
        turn.add(turned);
      }
    }
  }
  ASSERT_GT(shift_small.count, 500);
  ASSERT_GT(shift_large.count, 500);
  EXPECT_NEAR(shift_small.mean_within(), 1.0, 0.2);
  EXPECT_NEAR(shift_large.mean_within(), 1.0, 0.2);
  EXPECT_NEAR(turn.mean_within(), 1.0, 0.2);
  EXPECT_LT(turn.share_beyond(), 0.01);
}

TEST(CornerSigma, IsRightToAFactorForSaturatedPaper) {
  constexpr unsigned kScenes = 60;
  ChiSquare shift;
  TagSearch search({}, {});
  for (unsigned k = 0; k < kScenes; ++k) {
    const double light = 1.5 + 0.1 * k;
    for (const Found& found : find_in(search, make_corner_scene(kFirst + k, light), k)) {
      if (found.worst_px() > kOff_px) continue;
      const auto sides = side_sigmas(found.tag, found.pixel_noise);
      for (std::size_t i = 0; i < 4; ++i)
        if (found.tag.sides[i].clipped > 0.9) shift.add(side_squares(found, i, sides[i]).first);
    }
  }
  ASSERT_GT(shift.count, 200);
  EXPECT_GT(shift.mean(), 0.5);  // 100 without the term for clipping
  EXPECT_LT(shift.mean(), 2.0);
}

}  // namespace
}  // namespace fiducap
