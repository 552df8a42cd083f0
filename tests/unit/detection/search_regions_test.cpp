#include "detection/tag_search.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace fiducap {
namespace {

constexpr int kWidth = 752;
constexpr int kHeight = 480;

/// A square of this side, turned.
ExpectedTag square(Eigen::Vector2d centre, double side, double angle = 0, double sigma_px = 1) {
  ExpectedTag tag{7, {}, sigma_px};
  for (std::size_t i = 0; i < 4; ++i) {
    const double a = angle + M_PI_4 + M_PI_2 * static_cast<double>(i);
    tag.corners_px[i] = centre + side * M_SQRT1_2 * Eigen::Vector2d(std::cos(a), std::sin(a));
  }
  return tag;
}

/// Squares anywhere in the image, from far to near.
class RandomSquares final {
 public:
  explicit RandomSquares(unsigned seed) : random_(seed) {}
  ExpectedTag next() {
    const Eigen::Vector2d centre(within(0, kWidth), within(0, kHeight));
    const double side = within(12, 120);
    const double angle = within(0, 3);
    return square(centre, side, angle, within(0.5, 6));
  }
  int count(int most) { return 1 + static_cast<int>(within(0, most)); }

 private:
  double within(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  std::mt19937 random_;
};

bool is_inside(const ExpectedTag& tag, double margin) {
  return std::all_of(tag.corners_px.begin(), tag.corners_px.end(), [&](const Eigen::Vector2d& px) {
    return px.x() > margin && px.y() > margin && px.x() < kWidth - 1 - margin &&
           px.y() < kHeight - 1 - margin;
  });
}

std::vector<SearchRegion> planned(const std::vector<ExpectedTag>& tags) {
  std::vector<SearchRegion> regions;
  plan_regions(tags, kWidth, kHeight, {}, regions);
  return regions;
}

bool holds(const ImageRegion& region, const Eigen::Vector2d& px, double margin) {
  return px.x() >= region.left + margin && px.y() >= region.top + margin &&
         px.x() <= region.right - 1 - margin && px.y() <= region.bottom - 1 - margin;
}

TEST(SearchRegions, HoldEveryTagThatIsWellInsideWithRoomForItsUncertaintyAndItsQuietZone) {
  RandomSquares squares(3);
  int checked = 0;
  for (int run = 0; run < 300; ++run) {
    std::vector<ExpectedTag> tags;
    for (int i = squares.count(20); i > 0; --i) tags.push_back(squares.next());
    const auto regions = planned(tags);
    for (const ExpectedTag& tag : tags) {
      const double side = (tag.corners_px[1] - tag.corners_px[0]).norm();
      const double margin = 3 * tag.sigma_px + side / 8 + 5;
      if (!is_inside(tag, margin)) continue;
      ++checked;
      EXPECT_TRUE(std::any_of(regions.begin(), regions.end(),
                              [&](const SearchRegion& region) {
                                return std::all_of(tag.corners_px.begin(), tag.corners_px.end(),
                                                   [&](const Eigen::Vector2d& px) {
                                                     return holds(region.pixels, px, margin);
                                                   });
                              }))
          << "run " << run;
    }
  }
  EXPECT_GT(checked, 1000);
}

TEST(SearchRegions, LieInTheImageOnTheTilesOfTheWholeImage) {
  const auto regions = planned(
      {square({20, 20}, 30), square({kWidth - 40.0, kHeight - 40.0}, 70), square({300, 200}, 90)});
  ASSERT_EQ(regions.size(), 3u);
  for (const SearchRegion& region : regions) {
    EXPECT_GE(region.pixels.left, 0);
    EXPECT_GE(region.pixels.top, 0);
    EXPECT_LE(region.pixels.right, kWidth);
    EXPECT_LE(region.pixels.bottom, kHeight);
    EXPECT_EQ(region.pixels.left % (4 * region.decimate), 0);
    EXPECT_EQ(region.pixels.top % (4 * region.decimate), 0);
  }
}

TEST(SearchRegions, NeighboursAreJoinedAndDistantOnesAreNot) {
  EXPECT_EQ(planned({square({300, 200}, 30), square({345, 205}, 30)}).size(), 1u);
  EXPECT_EQ(planned({square({100, 100}, 30), square({600, 400}, 30)}).size(), 2u);
}

TEST(SearchRegions, JoiningNeverCostsMoreThanLeavingApart) {
  RandomSquares squares(5);
  for (int run = 0; run < 100; ++run) {
    std::vector<ExpectedTag> tags;
    double apart = 0;
    for (int i = 0; i < 12; ++i) {
      tags.push_back(squares.next());
      for (const SearchRegion& region : planned({tags.back()})) apart += region.cost();
    }
    double together = 0;
    for (const SearchRegion& region : planned(tags)) together += region.cost();
    EXPECT_LE(together, apart);
  }
}

TEST(SearchRegions, OnlyLargeTagsAreSearchedDecimated) {
  EXPECT_EQ(planned({square({300, 200}, 30)})[0].decimate, 1);
  EXPECT_EQ(planned({square({300, 200}, 45)})[0].decimate, 2);
  EXPECT_EQ(planned({square({300, 200}, 200)})[0].decimate, 4);
  // A large tag seen from the side is thin.
  ExpectedTag thin{1, {{{200, 300}, {212, 300}, {212, 180}, {200, 180}}}, 1};
  EXPECT_EQ(planned({thin})[0].decimate, 1);
}

TEST(SearchRegions, TagsOutsideOfTheImageAndInvalidNumbersAreSkipped) {
  ExpectedTag broken = square({300, 200}, 50);
  broken.corners_px[2].x() = std::numeric_limits<double>::quiet_NaN();
  ExpectedTag unbounded = square({300, 200}, 50);
  unbounded.sigma_px = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(planned({square({-100, 200}, 50), square({5, 200}, 50), broken, unbounded}).empty());
}

TEST(SearchRegions, AHugeUncertaintyIsTheWholeImage) {
  const auto regions = planned({square({300, 200}, 50, 0, 1e4)});
  ASSERT_EQ(regions.size(), 1u);
  EXPECT_EQ(regions[0].pixels, (ImageRegion{0, 0, kWidth, kHeight}));
}

}  // namespace
}  // namespace fiducap
