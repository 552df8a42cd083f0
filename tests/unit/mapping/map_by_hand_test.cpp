// Changes of the map of a running server by an operator.
#include <gmock/gmock.h>

#include "mapping/map_builder.hpp"
#include "mapping/map_refiner.hpp"
#include "support/results.hpp"
#include "unit/mapping/solution_fixture.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

constexpr int kBody = 1;

/// As from the store.
TagMap stored_map(std::int64_t version = 3) {
  TagMap map = make_map({2, 5, 7});
  map.version = version;
  map.hash = content_hash(map);
  return map;
}

class MapByHandTest : public testing::Test {
 protected:
  void adopt(int tag_id, double x, int epoch = 0) {
    builder_.adopt(solution_with(graph_estimate(tag_id, x, epoch)), kNow_utc_ns);
  }
  [[nodiscard]] const MapTag* tag(int id) {
    map_ = builder_.snapshot();
    return map_->find(id);
  }

  MapBuilder builder_{MapConfig{}, stored_map()};
  std::shared_ptr<const TagMap> map_;
};

TagMap other_map() {
  TagMap map = make_map({2, 5});
  map.tags[0].tag.X_WT.p.x() += 0.4;
  map.version = 9;
  return map;
}

TEST_F(MapByHandTest, ReplacesTheMap) {
  const auto revision = builder_.published().revision;
  ASSERT_TRUE(builder_.replace_map(other_map(), kNow_utc_ns));
  const auto view = builder_.published();
  EXPECT_EQ(view.map->version, 9);
  EXPECT_EQ(view.map->tags.size(), 2U);
  EXPECT_EQ(view.revision, revision + 1);
  builder_.mark_stored(other_map());
  EXPECT_FALSE(builder_.changed());
}

TEST_F(MapByHandTest, MovesTheTagsOfFilters) {
  ASSERT_TRUE(builder_.replace_map(other_map(), kNow_utc_ns));
  const auto known = builder_.view(kBody).map->known;
  ASSERT_NE(known->find(2), nullptr);
  EXPECT_EQ(known->find(2)->X_WT.p.x(), other_map().tags[0].tag.X_WT.p.x());
  EXPECT_EQ(known->find(7), nullptr);
  ASSERT_TRUE(builder_.replace_map(stored_map(), kNow_utc_ns));
  EXPECT_GT(builder_.view(kBody).map->known->revision, known->revision);
}

TEST_F(MapByHandTest, IgnoresContributionsToTheOldMap) {
  MapContribution one{.body_id = kBody,
                      .revision = builder_.view(kBody).revision,
                      .segment = std::make_shared<const MotionSegment>()};
  ASSERT_TRUE(builder_.replace_map(other_map(), kNow_utc_ns));
  builder_.absorb(one, kNow_utc_ns);
  EXPECT_TRUE(builder_.take_segments().segments.empty());
  one.revision = builder_.view(kBody).revision;
  builder_.absorb(one, kNow_utc_ns);
  EXPECT_EQ(builder_.take_segments().segments.size(), 1U);
}

TEST_F(MapByHandTest, DoesNotChangeAFrozenMap) {
  builder_.set_mode(MapMode::kFrozen);
  const auto before = builder_.snapshot();
  EXPECT_THAT(error_of(builder_.check_replacement(other_map())), HasSubstr("the map is frozen"));
  EXPECT_FALSE(builder_.replace_map(other_map(), kNow_utc_ns));
  EXPECT_THAT(builder_.forget(5, kNow_utc_ns).error().what, HasSubstr("the map is frozen"));
  EXPECT_EQ(builder_.snapshot(), before);
}

TEST_F(MapByHandTest, RefusesMapsWithoutWorkspaceOrOfOtherTags) {
  TagMap none = other_map();
  for (MapTag& entry : none.tags) entry.state = TagState::kQuarantined;
  EXPECT_THAT(error_of(builder_.replace_map(none, kNow_utc_ns)),
              HasSubstr("version 9 has no tag that defines the workspace"));
  TagMap foreign = other_map();
  foreign.family = "tag25h9";
  EXPECT_THAT(error_of(builder_.replace_map(foreign, kNow_utc_ns)),
              HasSubstr("holds tag25h9 tags"));
}

TEST_F(MapByHandTest, DoesNotUseAQuarantinedTag) {
  ASSERT_TRUE(builder_.quarantine(5, kNow_utc_ns));
  EXPECT_EQ(tag(5)->state, TagState::kQuarantined);
  EXPECT_EQ(tag(5) == nullptr ? nullptr : map_->known->find(5), nullptr);
  EXPECT_TRUE(builder_.changed());
  adopt(5, 3.0, 1);
  EXPECT_EQ(tag(5)->state, TagState::kQuarantined);
  const auto moves = builder_.take_segments().moves;
  ASSERT_EQ(moves.size(), 1U);
  EXPECT_EQ(moves.front().opens->back, Instant::max());
  EXPECT_THAT(builder_.quarantine(99, kNow_utc_ns).error().what, HasSubstr("has no tag 99"));
}

TEST_F(MapByHandTest, MapsAForgottenTagAgain) {
  constexpr Instant kNewest = instant_from_ns(4'000'000'000);
  builder_.absorb({.body_id = kBody, .at = kNewest}, kNow_utc_ns);
  ASSERT_TRUE(builder_.forget(5, kNow_utc_ns));
  EXPECT_EQ(tag(5), nullptr);
  EXPECT_EQ(map_->known->find(5), nullptr) << "no filter has it";
  adopt(5, 3.0);
  EXPECT_EQ(tag(5), nullptr) << "by old sightings";
  const auto moves = builder_.take_segments().moves;
  ASSERT_EQ(moves.size(), 1U);
  EXPECT_EQ(moves.front().opens->back, kNewest);
  adopt(5, 3.0, 1);
  ASSERT_NE(tag(5), nullptr);
  EXPECT_EQ(tag(5)->tag.X_WT.p.x(), 3.0);
}

TEST_F(MapByHandTest, MapsAForgottenQuarantinedTagAgain) {
  ASSERT_TRUE(builder_.quarantine(5, kNow_utc_ns));
  ASSERT_TRUE(builder_.forget(5, kNow_utc_ns));
  adopt(5, 3.0, 2);
  ASSERT_NE(tag(5), nullptr);
  EXPECT_NE(tag(5)->state, TagState::kQuarantined);
}

TEST_F(MapByHandTest, KeepsTagsThatDefineTheWorkspace) {
  ASSERT_TRUE(builder_.forget(2, kNow_utc_ns));
  ASSERT_TRUE(builder_.forget(5, kNow_utc_ns));
  EXPECT_THAT(builder_.forget(7, kNow_utc_ns).error().what, HasSubstr("the only one"));
  TagMap hangs = stored_map();
  hangs.reference_tag = 2;
  MapBuilder builder({}, hangs);
  EXPECT_THAT(builder.forget(2, kNow_utc_ns).error().what, HasSubstr("reference tag"));
}

TEST_F(MapByHandTest, StoresAnAlignmentThatMovesNoTag) {
  const auto before = builder_.snapshot();
  const Pose X_RW{Eigen::Quaterniond::Identity(), {4, 5, 6}};
  builder_.align(X_RW, kNow_utc_ns);
  EXPECT_EQ(builder_.snapshot()->X_RW.p, X_RW.p);
  EXPECT_EQ(builder_.snapshot()->tags[0].tag.X_WT.p, before->tags[0].tag.X_WT.p);
  EXPECT_TRUE(builder_.changed());
  builder_.mark_stored(*before);
  EXPECT_TRUE(builder_.changed()) << "stored without the alignment";
}

TEST(MapByHand, DoesNotAdoptASolutionOfTheOldMap) {
  MapBuilder builder({}, stored_map());
  MapRefiner refiner(builder);
  builder.adopt(solution_with(graph_estimate(5, 3.0)), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(5)->tag.X_WT.p.x(), 3.0);
  ASSERT_TRUE(builder.replace_map(other_map(), kNow_utc_ns));
  const auto before = builder.snapshot();
  builder.adopt(solution_with(graph_estimate(5, 4.0)), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot(), before) << "the refiner had the old map";
  refiner.take();
  builder.adopt(solution_with(graph_estimate(5, 4.0)), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(5)->tag.X_WT.p.x(), 4.0) << "the refiner has the new map";
}

TEST(MapByHand, RestartsTheRefinerWithTheNewMap) {
  TagMap start = stored_map();
  for (MapTag& entry : start.tags) entry.state = TagState::kSurveyed;
  MapBuilder builder({}, start);
  MapRefiner refiner(builder);
  EXPECT_EQ(refiner.graph().state().tags.size(), 3U);
  TagMap next = other_map();
  for (MapTag& entry : next.tags) entry.state = TagState::kSurveyed;
  ASSERT_TRUE(builder.replace_map(next, kNow_utc_ns));
  EXPECT_FALSE(refiner.solve()) << "no new segments";
  ASSERT_EQ(refiner.graph().state().tags.size(), 2U);
  EXPECT_EQ(refiner.graph().state().tags[0].X_WT.p, next.tags[0].tag.X_WT.p);
  EXPECT_EQ(builder.take_segments().replacement, nullptr) << "once";
}

}  // namespace
}  // namespace fiducap
