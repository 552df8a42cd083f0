// Changes of the map of a running server by an operator.
#include <gmock/gmock.h>

#include "mapping/map_builder.hpp"
#include "mapping/map_refiner.hpp"
#include "support/results.hpp"
#include "unit/mapping/belief_fixture.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

constexpr int kBody = 1;
constexpr int kViewsToDeliver = 10;

/// As from the store.
TagMap stored_map(std::int64_t version = 3) {
  TagMap map = make_map({2, 5, 7});
  map.version = version;
  map.hash = content_hash(map);
  return map;
}

GraphSolution solution_with(int tag_id, double x, int epoch = 0) {
  GraphSolution solution;
  solution.tags.push_back(graph_estimate(tag_id, x, epoch));
  return solution;
}

class MapByHandTest : public testing::TestWithParam<double> {
 protected:
  [[nodiscard]] static bool has_graph() { return GetParam() > 0; }
  /// The body has received the map.
  void deliver(int body_id = kBody) {
    for (int i = 0; i < kViewsToDeliver; ++i) (void)builder_.view(body_id);
  }
  /// Tag 5 is estimated at x = 3.
  void see_at_3(int epoch) {
    if (has_graph()) builder_.adopt(solution_with(5, 3.0, epoch), kNow_utc_ns);
    if (!has_graph()) see(belief(5, 0.01, 3.0));
  }
  void see(const TagBelief& one) { builder_.absorb(from(kBody, one), kNow_utc_ns); }
  [[nodiscard]] const MapTag* tag(int id) {
    map_ = builder_.snapshot();
    return map_->find(id);
  }

  MapBuilder builder_{MapConfig{.refine_period_s = GetParam()}, stored_map()};
  std::shared_ptr<const TagMap> map_;
};

INSTANTIATE_TEST_SUITE_P(With, MapByHandTest, testing::Values(0.0, 2.0), [](const auto& with) {
  return std::string(with.param > 0 ? "Graph" : "Beliefs");
});

TagMap other_map() {
  TagMap map = make_map({2, 5});
  map.tags[0].tag.X_WT.p.x() += 0.4;
  map.version = 9;
  return map;
}

TEST_P(MapByHandTest, ReplacesTheMap) {
  const auto revision = builder_.published().revision;
  ASSERT_TRUE(builder_.replace_map(other_map(), kNow_utc_ns));
  const auto view = builder_.published();
  EXPECT_EQ(view.map->version, 9);
  EXPECT_EQ(view.map->tags.size(), 2U);
  EXPECT_EQ(view.revision, revision + 1);
  builder_.mark_stored(other_map());
  EXPECT_FALSE(builder_.changed());
}

TEST_P(MapByHandTest, DeliversTheNewMapToEachBody) {
  ASSERT_TRUE(builder_.replace_map(other_map(), kNow_utc_ns));
  const auto known = builder_.view(kBody).map->known;
  ASSERT_NE(known, nullptr) << "its own tags are moved, too";
  EXPECT_EQ(known->tags.size(), 2U);
  deliver();
  EXPECT_EQ(builder_.view(kBody).map->known != nullptr, has_graph());
  EXPECT_NE(builder_.view(kBody + 1).map->known, nullptr) << "another body has not received it";
  ASSERT_TRUE(builder_.replace_map(stored_map(), kNow_utc_ns));
  EXPECT_GT(builder_.view(kBody).map->known->revision, known->revision);
}

TEST_P(MapByHandTest, IgnoresContributionsToTheOldMap) {
  (void)builder_.view(kBody);
  ASSERT_TRUE(builder_.replace_map(other_map(), kNow_utc_ns));
  const TagBelief seen = belief(11);
  MapContribution late = from(kBody, seen);
  late.segment = std::make_shared<const MotionSegment>();
  builder_.absorb(late, kNow_utc_ns);
  EXPECT_EQ(tag(11), nullptr);
  EXPECT_TRUE(builder_.take_segments().segments.empty());
  deliver();
  builder_.absorb(late, kNow_utc_ns);
  EXPECT_EQ(tag(11) != nullptr, !has_graph());
  EXPECT_EQ(builder_.take_segments().segments.size(), 1U);
}

TEST_P(MapByHandTest, DoesNotChangeAFrozenMap) {
  builder_.set_mode(MapMode::kFrozen);
  const auto before = builder_.snapshot();
  EXPECT_THAT(error_of(builder_.check_replacement(other_map())), HasSubstr("the map is frozen"));
  EXPECT_FALSE(builder_.replace_map(other_map(), kNow_utc_ns));
  EXPECT_THAT(builder_.forget(5, kNow_utc_ns).error().what, HasSubstr("the map is frozen"));
  EXPECT_EQ(builder_.snapshot(), before);
}

TEST_P(MapByHandTest, RefusesMapsWithoutWorkspaceOrOfOtherTags) {
  TagMap none = other_map();
  for (MapTag& entry : none.tags) entry.state = TagState::kQuarantined;
  EXPECT_THAT(error_of(builder_.replace_map(none, kNow_utc_ns)),
              HasSubstr("version 9 has no tag that defines the workspace"));
  TagMap foreign = other_map();
  foreign.family = "tag25h9";
  EXPECT_THAT(error_of(builder_.replace_map(foreign, kNow_utc_ns)),
              HasSubstr("holds tag25h9 tags"));
}

TEST_P(MapByHandTest, DoesNotUseAQuarantinedTag) {
  ASSERT_TRUE(builder_.quarantine(5, kNow_utc_ns));
  EXPECT_EQ(tag(5)->state, TagState::kQuarantined);
  EXPECT_TRUE(builder_.changed());
  see(belief(5));
  if (has_graph()) builder_.adopt(solution_with(5, 3.0, 1), kNow_utc_ns);
  EXPECT_EQ(tag(5)->state, TagState::kQuarantined);
  const auto moves = builder_.take_segments().moves;
  ASSERT_EQ(moves.size(), has_graph() ? 1U : 0U);
  for (const auto& move : moves) EXPECT_EQ(move.opens->back, Instant::max());
  EXPECT_THAT(builder_.quarantine(99, kNow_utc_ns).error().what, HasSubstr("has no tag 99"));
}

TEST_P(MapByHandTest, MapsAForgottenTagAgain) {
  see(belief(2));
  ASSERT_TRUE(builder_.forget(5, kNow_utc_ns));
  EXPECT_EQ(tag(5), nullptr);
  if (has_graph()) builder_.adopt(solution_with(5, 3.0), kNow_utc_ns);
  see(belief(5));
  EXPECT_EQ(tag(5), nullptr) << "by an old belief";
  EXPECT_EQ(builder_.view(kBody).forget, std::vector<int>{5});
  deliver();
  EXPECT_TRUE(builder_.view(kBody).forget.empty());
  EXPECT_EQ(builder_.view(kBody + 1).forget, std::vector<int>{5});
  const auto moves = builder_.take_segments().moves;
  ASSERT_EQ(moves.size(), has_graph() ? 1U : 0U);
  for (const auto& move : moves) EXPECT_EQ(move.opens->back, belief(5).last_seen) << "the newest";
  see_at_3(1);
  ASSERT_NE(tag(5), nullptr);
  EXPECT_EQ(tag(5)->tag.X_WT.p.x(), 3.0);
}

TEST_P(MapByHandTest, MapsAForgottenQuarantinedTagAgain) {
  ASSERT_TRUE(builder_.quarantine(5, kNow_utc_ns));
  ASSERT_TRUE(builder_.forget(5, kNow_utc_ns));
  deliver();
  see_at_3(2);
  ASSERT_NE(tag(5), nullptr);
  EXPECT_NE(tag(5)->state, TagState::kQuarantined);
}

TEST_P(MapByHandTest, KeepsTagsThatDefineTheWorkspace) {
  ASSERT_TRUE(builder_.forget(2, kNow_utc_ns));
  ASSERT_TRUE(builder_.forget(5, kNow_utc_ns));
  EXPECT_THAT(builder_.forget(7, kNow_utc_ns).error().what, HasSubstr("the only one"));
  TagMap hangs = stored_map();
  hangs.reference_tag = 2;
  MapBuilder builder({.refine_period_s = GetParam()}, hangs);
  EXPECT_THAT(builder.forget(2, kNow_utc_ns).error().what, HasSubstr("reference tag"));
}

TEST_P(MapByHandTest, StoresAnAlignmentThatMovesNoTag) {
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
  MapBuilder builder({.refine_period_s = 2}, stored_map());
  MapRefiner refiner(builder);
  builder.adopt(solution_with(5, 3.0), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(5)->tag.X_WT.p.x(), 3.0);
  ASSERT_TRUE(builder.replace_map(other_map(), kNow_utc_ns));
  const auto before = builder.snapshot();
  builder.adopt(solution_with(5, 4.0), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot(), before) << "the refiner had the old map";
  refiner.take();
  builder.adopt(solution_with(5, 4.0), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(5)->tag.X_WT.p.x(), 4.0) << "the refiner has the new map";
}

TEST(MapByHand, RestartsTheRefinerWithTheNewMap) {
  TagMap start = stored_map();
  for (MapTag& entry : start.tags) entry.state = TagState::kSurveyed;
  MapBuilder builder({.refine_period_s = 2}, start);
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
