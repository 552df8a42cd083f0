#include "detection/tag_search.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "detection/image_measures.hpp"
#include "rendered_wall.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::IsEmpty;

constexpr Instant ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

class TagSearchTest : public testing::Test {
 protected:
  static constexpr std::initializer_list<int> kAll{0, 1, 2, 3, 4, 5};

  static DetectorConfig config() { return {.search_period_s = 1.0}; }

  /// These tags, expected this far off.
  std::vector<ExpectedTag> expecting(const std::vector<int>& ids, double off_px = 0,
                                     double sigma_px = 1) const {
    std::vector<ExpectedTag> expected;
    for (const int id : ids) {
      expected.push_back({id, wall_.corners(wall_.tags[static_cast<std::size_t>(id)]), sigma_px});
      for (auto& px : expected.back().corners_px) px.x() += off_px;
    }
    return expected;
  }

  std::vector<int> search(Instant at, const std::vector<ExpectedTag>& expected, int camera = 0) {
    std::vector<int> ids;
    for (const TagSighting& tag : search_.search({camera, at, image_}, expected).tags)
      ids.push_back(tag.tag_id);
    return ids;
  }

  /// Another image, from this distance.
  void photograph_from(double distance_m) {
    wall_.X_WV = simulation::facing_camera(distance_m);
    image_ = wall_.photograph();
  }

  RenderedWall wall_;
  std::shared_ptr<const GrayImage> image_{wall_.photograph()};
  TagSearch search_{{}, config()};
};

TEST_F(TagSearchTest, SearchesTheWholeImageWithoutExpectationsOrRegions) {
  for (int k = 0; k < 3; ++k) EXPECT_THAT(search(ms(50 * k), {}), ElementsAreArray(kAll));
  EXPECT_EQ(search_.statistics().whole_images, 3u);
  DetectorConfig plain = config();
  plain.regions = false;
  search_ = TagSearch({}, plain);
  for (int k = 0; k < 3; ++k)
    EXPECT_THAT(search(ms(50 * k), expecting({0})), ElementsAreArray(kAll));
  image_ = nullptr;
  EXPECT_THAT(search(ms(150), {}), IsEmpty());
}

TEST_F(TagSearchTest, SearchesRegionsAndTheWholeImageOnSchedule) {
  EXPECT_THAT(search(ms(0), expecting({0, 2})), ElementsAreArray(kAll))
      << "the first image is searched whole";
  EXPECT_THAT(search(ms(50), expecting({0, 2})), ElementsAre(0, 2));
  EXPECT_THAT(search(ms(950), expecting({0, 2})), ElementsAre(0, 2));
  EXPECT_THAT(search(ms(1000), expecting({0, 2})), ElementsAreArray(kAll));
  EXPECT_THAT(search(ms(1050), expecting({0, 2})), ElementsAre(0, 2));
  EXPECT_EQ(search_.statistics().whole_images, 2u);
  EXPECT_EQ(search_.statistics().expected, 10u);
  EXPECT_EQ(search_.statistics().found, 10u);
}

TEST_F(TagSearchTest, FindsSmallTagsByStripsAtFullResolution) {
  photograph_from(4.2);  // 11 px: 5 of them left by decimate 2
  TagDetector coarse({}, config());
  ASSERT_THAT(coarse.detect({0, ms(0), image_}).tags, IsEmpty());
  std::set<int> ids;
  for (int k = 0; k < 4; ++k)
    for (const int id : search(ms(1000 * k), {})) ids.insert(id);
  EXPECT_THAT(ids, ElementsAreArray(kAll));
  EXPECT_THAT(search(ms(3050), expecting(kAll)), ElementsAreArray(kAll));
}

TEST_F(TagSearchTest, RestartsTheScheduleForAnOlderImage) {
  (void)search(ms(90'000), expecting({0}));
  EXPECT_THAT(search(ms(10), expecting({0})), ElementsAreArray(kAll));
  EXPECT_THAT(search(ms(60), expecting({0})), ElementsAre(0));
}

TEST_F(TagSearchTest, SearchesTheWholeImageForALostTag) {
  for (int k = 0; k < 4; ++k) (void)search(ms(50 * k), expecting({0, 2}));
  auto expected = expecting({0});
  expected.push_back(expecting({2}, -90)[0]);  // moved
  EXPECT_THAT(search(ms(200), expected), ElementsAreArray(kAll));
}

TEST_F(TagSearchTest, SearchesNotForATagThatWasNeverFound) {
  wall_.tags.pop_back();  // id 5
  auto expected = expecting({0});
  expected.push_back({5, wall_.corners(wall_.tags[1]), 1.0});
  (void)search(ms(0), expected);
  for (int k = 1; k < 15; ++k) (void)search(ms(50 * k), expected);
  EXPECT_EQ(search_.statistics().whole_images, 1u);
}

TEST_F(TagSearchTest, SearchesTheWholeImageWhenNoTagIsFound) {
  (void)search(ms(0), expecting({0}));
  EXPECT_THAT(search(ms(50), expecting({0}, 120)), ElementsAreArray(kAll));
}

TEST_F(TagSearchTest, SearchesTheWholeImageWhenRegionsCostMore) {
  photograph_from(1.8);  // tags of 25 px
  (void)search(ms(0), expecting({0}));
  (void)search(ms(50), expecting(kAll, 0, 60));
  EXPECT_EQ(search_.statistics().whole_images, 2u);
}

TEST_F(TagSearchTest, FindsADoubledIdTwiceInTheWholeImage) {
  wall_.tags[3].tag_id = 0;
  image_ = wall_.photograph();
  EXPECT_THAT(search(ms(0), expecting({0})), ElementsAre(0, 0, 1, 2, 4, 5));
}

TEST_F(TagSearchTest, AlternatesBetweenTheCamerasOfABody) {
  int both = 0;
  for (int k = 1; k < 41; ++k) {
    const auto before = search_.statistics().whole_images;
    (void)search(ms(50 * k), expecting({0}), 0);
    (void)search(ms(50 * k), expecting({0}), 1);
    both += search_.statistics().whole_images == before + 2 ? 1 : 0;
  }
  EXPECT_EQ(both, 0);
  EXPECT_EQ(search_.statistics().whole_images, 4u) << "two seconds, two cameras";
}

TEST_F(TagSearchTest, MeasuresNoiseAndSharpness) {
  const CornerFrame& found = search_.search({0, ms(0), image_}, {});
  EXPECT_NEAR(found.pixel_noise, 2.0, 0.5);
  ASSERT_FALSE(found.tags.empty());
  for (const TagSighting& tag : found.tags) EXPECT_GT(tag.sharpness, 0.8);
}

// libapriltag allocates in each call: as many allocations as its calls alone.
TEST_F(TagSearchTest, AllocatesOnlyInLibapriltagAfterWarmUp) {
  const auto expected = expecting({0, 1, 2, 3});
  (void)search(ms(0), expected);
  for (int k = 1; k < 10; ++k) (void)search(ms(50 * k), expected);
  const AllocationCounter with_ours;
  (void)search_.search({0, ms(500), image_}, expected);
  const std::uint64_t of_search = with_ours.count();

  std::vector<SearchRegion> regions;
  plan_regions(expected, image_->width, image_->height, {}, regions);
  TagDetector detector({}, config());
  std::vector<TagSighting> found;
  const int contrast = contrast_above(*search_.noise(), config());
  const auto library = [&] {
    found.clear();
    for (const SearchRegion& r : regions)
      detector.detect(*image_, r.pixels, {double(r.decimate), contrast}, found);
  };
  library();
  const AllocationCounter alone;
  library();
  const std::uint64_t of_library = alone.count();
  EXPECT_TRUE(of_library > 0u || !AllocationCounter::counts_malloc());
  EXPECT_EQ(of_search, of_library);
}

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
  return std::ranges::all_of(tag.corners_px, [&](const Eigen::Vector2d& px) {
    return px.x() > margin && px.y() > margin && px.x() < kWidth - 1 - margin &&
           px.y() < kHeight - 1 - margin;
  });
}

std::vector<SearchRegion> planned(const std::vector<ExpectedTag>& tags) {
  std::vector<SearchRegion> regions;
  plan_regions(tags, kWidth, kHeight, {}, regions);
  return regions;
}

bool holds(const ImageRegion& region, const ExpectedTag& tag, double margin) {
  return std::ranges::all_of(tag.corners_px, [&](const Eigen::Vector2d& px) {
    return px.x() >= region.left + margin && px.y() >= region.top + margin &&
           px.x() <= region.right - 1 - margin && px.y() <= region.bottom - 1 - margin;
  });
}

TEST(SearchRegions, HoldTagsWithTheirUncertaintyAndQuietZone) {
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
      EXPECT_TRUE(std::ranges::any_of(
          regions, [&](const SearchRegion& r) { return holds(r.pixels, tag, margin); }))
          << "run " << run;
    }
  }
  EXPECT_GT(checked, 1000);
}

TEST(SearchRegions, AreAlignedToTheTilesOfTheImage) {
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

TEST(SearchRegions, JoinNeighboursOnly) {
  EXPECT_EQ(planned({square({300, 200}, 30), square({345, 205}, 30)}).size(), 1u);
  EXPECT_EQ(planned({square({100, 100}, 30), square({600, 400}, 30)}).size(), 2u);
}

TEST(SearchRegions, NeverCostMoreWhenJoined) {
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

TEST(SearchRegions, AreDecimatedForLargeTagsOnly) {
  EXPECT_EQ(planned({square({300, 200}, 30)})[0].decimate, 1);
  EXPECT_EQ(planned({square({300, 200}, 45)})[0].decimate, 2);
  EXPECT_EQ(planned({square({300, 200}, 200)})[0].decimate, 4);
  // A large tag seen from the side is thin.
  ExpectedTag thin{1, {{{200, 300}, {212, 300}, {212, 180}, {200, 180}}}, 1};
  EXPECT_EQ(planned({thin})[0].decimate, 1);
}

TEST(SearchRegions, SkipTagsOutsideAndInvalidNumbers) {
  ExpectedTag broken = square({300, 200}, 50);
  broken.corners_px[2].x() = std::numeric_limits<double>::quiet_NaN();
  ExpectedTag unbounded = square({300, 200}, 50);
  unbounded.sigma_px = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(planned({square({-100, 200}, 50), square({5, 200}, 50), broken, unbounded}).empty());
}

TEST(SearchRegions, AreTheWholeImageForAHugeUncertainty) {
  const auto regions = planned({square({300, 200}, 50, 0, 1e4)});
  ASSERT_EQ(regions.size(), 1u);
  EXPECT_EQ(regions[0].pixels, (ImageRegion{0, 0, kWidth, kHeight}));
}

}  // namespace
}  // namespace fiducap
