#include "detection/tag_search.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "detection/image_measures.hpp"
#include "rendered_wall.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr Instant ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

class TagSearchTest : public testing::Test {
 protected:
  static DetectorConfig config() {
    DetectorConfig c;
    c.search_period_s = 1.0;
    return c;
  }

  /// What is expected of these tags, all of them off by this much.
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

  RenderedWall wall_;
  std::shared_ptr<const GrayImage> image_{wall_.photograph()};
  TagSearch search_{{}, config()};
};

TEST_F(TagSearchTest, WithoutExpectationsTheWholeImageIsSearched) {
  for (int k = 0; k < 3; ++k) EXPECT_THAT(search(ms(50 * k), {}), ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_EQ(search_.statistics().whole_images, 3u);
}

TEST_F(TagSearchTest, ExpectedTagsAreFoundInTheirRegionsAndNewOnesOnSchedule) {
  EXPECT_THAT(search(ms(0), expecting({0, 2})), ElementsAre(0, 1, 2, 3, 4, 5))
      << "the first image is searched whole";
  EXPECT_THAT(search(ms(50), expecting({0, 2})), ElementsAre(0, 2));
  EXPECT_THAT(search(ms(950), expecting({0, 2})), ElementsAre(0, 2));
  EXPECT_THAT(search(ms(1000), expecting({0, 2})), ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(search(ms(1050), expecting({0, 2})), ElementsAre(0, 2));
  EXPECT_EQ(search_.statistics().whole_images, 2u);
  EXPECT_EQ(search_.statistics().expected, 10u);
  EXPECT_EQ(search_.statistics().found, 10u);
}

TEST_F(TagSearchTest, TagsTooSmallForTheWholeSearchAreFoundByTheStripsAtFullResolution) {
  wall_.X_WV = simulation::facing_camera(4.2);  // 11 px: 5 of them left by decimate 2
  image_ = wall_.photograph();
  TagDetector coarse({}, config());
  ASSERT_THAT(coarse.detect({0, ms(0), image_}).tags, IsEmpty());
  std::set<int> ids;
  for (int k = 0; k < 4; ++k)
    for (const int id : search(ms(1000 * k), {})) ids.insert(id);
  EXPECT_THAT(ids, ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(search(ms(3050), expecting({0, 1, 2, 3, 4, 5})), ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(TagSearchTest, AnImageOlderThanTheLastOneStartsTheScheduleAgain) {
  (void)search(ms(90'000), expecting({0}));
  EXPECT_THAT(search(ms(10), expecting({0})), ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(search(ms(60), expecting({0})), ElementsAre(0));
}

TEST_F(TagSearchTest, ASteadyTagThatIsMissingIsLookedForInTheWholeImageAtOnce) {
  for (int k = 0; k < 4; ++k) (void)search(ms(50 * k), expecting({0, 2}));
  auto expected = expecting({0});
  expected.push_back(expecting({2}, -90)[0]);  // it is not there any more
  EXPECT_THAT(search(ms(200), expected), ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(TagSearchTest, ATagThatIsNeverThereCallsForNoSearch) {
  wall_.tags.pop_back();  // id 5
  auto expected = expecting({0});
  expected.push_back({5, wall_.corners(wall_.tags[1]), 1.0});
  (void)search(ms(0), expected);
  for (int k = 1; k < 15; ++k) (void)search(ms(50 * k), expected);
  EXPECT_EQ(search_.statistics().whole_images, 1u);
}

TEST_F(TagSearchTest, WhenNothingIsWhereItShouldBeTheWholeImageIsSearched) {
  (void)search(ms(0), expecting({0}));
  EXPECT_THAT(search(ms(50), expecting({0}, 120)), ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(TagSearchTest, RegionsThatCostMoreThanTheImageAreLeft) {
  wall_.X_WV = simulation::facing_camera(1.8);  // tags of 25 px
  image_ = wall_.photograph();
  (void)search(ms(0), expecting({0}));
  (void)search(ms(50), expecting({0, 1, 2, 3, 4, 5}, 0, 60));
  EXPECT_EQ(search_.statistics().whole_images, 2u);
}

// Not the same to the last digit: the library's line fit rounds pixel by pixel, so another start
// gives another twentieth of a pixel. What counts is the truth.
TEST_F(TagSearchTest, CornersAreAsCloseToTheTruthAsThoseOfTheWholeImageAtFullResolution) {
  DetectorConfig full;
  full.decimate = 1;
  TagDetector detector({}, full);
  constexpr double kNoWorse = 1.1;  // 400 corners of each size determine an RMS to a twentieth
  for (const double distance : {0.84, 1.2, 1.8}) {
    double theirs = 0;
    double ours = 0;
    for (int k = 0; k < 17; ++k) {
      wall_.X_WV = simulation::facing_camera(distance);
      wall_.X_WV.p.x() += 0.003 * k;
      image_ = wall_.photograph(static_cast<std::uint64_t>(k));
      const CornerFrame whole_image = detector.detect({0, ms(0), image_});
      const auto expected = expecting({0, 1, 2, 3, 4, 5}, 2.0);
      (void)search(ms(100 * k), expected);
      const auto& found = search_.search({0, ms(100 * k + 50), image_}, expected);
      ASSERT_EQ(found.tags.size(), 6u);
      ASSERT_EQ(whole_image.tags.size(), 6u);
      for (std::size_t t = 0; t < 6; ++t) {
        const auto truth = wall_.corners(wall_.tags[t]);
        for (std::size_t i = 0; i < 4; ++i) {
          theirs += (whole_image.tags[t].corners_px[i] - truth[i]).squaredNorm();
          ours += (found.tags[t].corners_px[i] - truth[i]).squaredNorm();
        }
      }
    }
    EXPECT_LT(std::sqrt(ours), kNoWorse * std::sqrt(theirs)) << distance;
  }
}

TEST_F(TagSearchTest, AnIdPrintedTwiceComesTwiceWhenTheWholeImageIsSearched) {
  wall_.tags[3].tag_id = 0;
  image_ = wall_.photograph();
  EXPECT_THAT(search(ms(0), expecting({0})), ElementsAre(0, 0, 1, 2, 4, 5));
}

TEST_F(TagSearchTest, CamerasOfABodyShareTheDetectorAndTakeTurns) {
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

TEST_F(TagSearchTest, WithoutRegionsEveryImageIsSearchedWhole) {
  DetectorConfig plain = config();
  plain.regions = false;
  search_ = TagSearch({}, plain);
  for (int k = 0; k < 3; ++k)
    EXPECT_THAT(search(ms(50 * k), expecting({0})), ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(TagSearchTest, MeasuresTheNoiseAndTheSharpnessOfWhatItFinds) {
  const CornerFrame& found = search_.search({0, ms(0), image_}, {});
  EXPECT_NEAR(found.pixel_noise, 2.0, 0.5);
  ASSERT_FALSE(found.tags.empty());
  for (const TagSighting& tag : found.tags) EXPECT_GT(tag.sharpness, 0.8);
}

TEST_F(TagSearchTest, AFrameWithoutImageGivesNothing) {
  image_ = nullptr;
  EXPECT_THAT(search(ms(0), {}), IsEmpty());
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
  if (AllocationCounter::counts_malloc()) {
    EXPECT_GT(of_library, 0u);
  }
  EXPECT_EQ(of_search, of_library);
}

}  // namespace
}  // namespace fiducap
