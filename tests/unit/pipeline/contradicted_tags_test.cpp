#include "pipeline/contradicted_tags.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

constexpr Instant after_ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

/// A body that has rejected tag 4 of the map.
class ContradictedTagsTest : public testing::Test {
 protected:
  ContradictedTagsTest() {
    for (const int id : {4, 5}) {
      known_.tags.push_back(place(id));
      map_.tags.push_back({.tag = place(id)});
    }
    known_.pairs.push_back({4, 5, Matrix6d::Zero()});
    known_.revision = 3;
    publish();
    contradicted_.add(map_, 4);
  }
  static KnownTag place(int id, double x = 1) {
    KnownTag tag{.tag_id = id, .edge_m = 0.16, .X_WT = {}};
    tag.X_WT.p.x() = x;
    tag.covariance = Matrix6d::Identity() * 1e-6;
    return tag;
  }
  void publish() { map_.known = std::make_shared<const KnownMap>(known_); }
  const KnownMap& use() {
    in_image_ = {place(4), place(5)};
    return *contradicted_.use(map_, in_image_);
  }
  [[nodiscard]] bool is_used() { return use().find(4) != nullptr && in_image_.size() == 2; }
  /// @return whether it has contradicted the map again
  bool estimate_at(double x, int sightings) {
    std::vector<int> again;
    contradicted_.compare(
        std::vector<TagBelief>{{place(4, x), sightings, after_ms(0), after_ms(1000)}}, again);
    return !again.empty();
  }

  TagMap map_;
  KnownMap known_;
  std::vector<KnownTag> in_image_;
  ContradictedTags contradicted_;
};

TEST_F(ContradictedTagsTest, AreNotGivenToTheFilter) {
  const KnownMap& rest = use();
  EXPECT_EQ(rest.find(4), nullptr);
  EXPECT_NE(rest.find(5), nullptr);
  EXPECT_TRUE(rest.pairs.empty());
  EXPECT_EQ(rest.revision, 3u) << "nothing else has changed";
  ASSERT_EQ(in_image_.size(), 1u);
  EXPECT_EQ(in_image_[0].tag_id, 5);
  EXPECT_EQ(&use(), &rest) << "made once";
}

TEST_F(ContradictedTagsTest, AreReportedAgainAndAgain) {
  EXPECT_FALSE(estimate_at(2, 9));
  EXPECT_TRUE(estimate_at(2, 10));
  EXPECT_FALSE(estimate_at(2, 19));
  EXPECT_TRUE(estimate_at(2, 20));
  EXPECT_FALSE(is_used());
}

TEST_F(ContradictedTagsTest, AreUsedAgainWhenTheBodyAgreesWithTheMap) {
  EXPECT_FALSE(estimate_at(1.001, 19));
  EXPECT_FALSE(is_used()) << "seen too seldom";
  EXPECT_FALSE(estimate_at(1.001, 20));
  EXPECT_TRUE(is_used());
  EXPECT_NE(use().revision, 3u) << "the filter takes it over";
}

TEST_F(ContradictedTagsTest, AreUsedAgainWhenTheMapMovesThem) {
  map_.tags[0].tag.X_WT.p.x() = 2;
  EXPECT_TRUE(is_used());
}

TEST_F(ContradictedTagsTest, AreUsedAgainWhenTheBodyWasLost) {
  contradicted_.forget_all();
  EXPECT_TRUE(is_used());
}

TEST_F(ContradictedTagsTest, AreNotInSegments) {
  MotionSegment segment;
  segment.tags = {place(4), place(5)};
  MotionSegment::Instance& instance = segment.instances.emplace_back();
  for (const int id : {4, 5}) {
    SegmentImage& image = instance.images.emplace_back();
    image.tags.emplace_back().seen.tag_id = id;
  }
  const auto rest = contradicted_.without(std::make_shared<const MotionSegment>(segment));
  ASSERT_EQ(rest->tags.size(), 1u);
  EXPECT_EQ(rest->tags[0].tag_id, 5);
  ASSERT_EQ(rest->instances[0].images.size(), 1u);
  EXPECT_EQ(rest->instances[0].images[0].tags[0].seen.tag_id, 5);
}

}  // namespace
}  // namespace fiducap
