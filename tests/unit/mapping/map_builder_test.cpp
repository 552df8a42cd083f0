#include "mapping/map_builder.hpp"

#include <gmock/gmock.h>

#include <optional>
#include <thread>

#include "unit/mapping/solution_fixture.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;

class MapBuilderTest : public testing::Test {
 protected:
  MapBuilderTest() { start(make_map({2, 5})); }
  void start(const TagMap& map) { builder_.emplace(MapConfig{}, map); }
  void adopt(const GraphTagEstimate& tag) { builder_->adopt(solution_with(tag), kNow_utc_ns); }
  void see(int id, double x = 1.0) { adopt(graph_estimate(id, x)); }
  /// As version 12, made from version 11.
  void store_as_12(TagMap map) {
    map.version = 12;
    map.parent = 11;
    map.hash = "abc";
    builder_->mark_stored(map);
  }
  [[nodiscard]] MapTag tag(int id) const {
    const MapTag* found = builder_->snapshot()->find(id);
    return found == nullptr ? MapTag{} : *found;
  }
  [[nodiscard]] double x_of(int id) const { return tag(id).tag.X_WT.p.x(); }

  std::optional<MapBuilder> builder_;
};

TEST_F(MapBuilderTest, AddsATagOfTheSolution) {
  const auto before = builder_->snapshot();
  GraphTagEstimate young = graph_estimate(3, 1.0);
  young.sightings = 20;
  adopt(young);
  EXPECT_EQ(before->find(3), nullptr);  // a snapshot never changes
  const auto after = builder_->snapshot();
  const MapTag* joined = after->find(3);
  ASSERT_NE(joined, nullptr);
  EXPECT_EQ(joined->state, TagState::kLocal);
  EXPECT_EQ(joined->component, 0);
  EXPECT_EQ(joined->sightings, 20);
  EXPECT_EQ(joined->last_seen_utc_ns, kNow_utc_ns);
  EXPECT_EQ(joined->first_seen_utc_ns, kNow_utc_ns - 9'000'000'000);
  EXPECT_EQ(joined->tag.X_WT.p.x(), 1.0);
  EXPECT_EQ(after->created_utc_ns, kNow_utc_ns);
  EXPECT_TRUE(builder_->changed());
  EXPECT_EQ(fault_in(*after), std::nullopt);
}

TEST_F(MapBuilderTest, RefusesRareUnconnectedAndInvalidTags) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  GraphTagEstimate rare = graph_estimate(3, 1.0);
  rare.sightings = 9;
  GraphTagEstimate apart = graph_estimate(3, 1.0);
  apart.component = 1;
  for (const GraphTagEstimate& bad : {rare, apart, graph_estimate(3, kNan),
                                      graph_estimate(3, 1.0, 0, kNan), graph_estimate(-3, 1.0)})
    adopt(bad);
  EXPECT_EQ(builder_->snapshot()->tags.size(), 2u);
}

TEST_F(MapBuilderTest, AddsTagsWithFewSightingsOffline) {
  GraphTagEstimate rare = graph_estimate(3, 1.0);
  rare.sightings = 1;
  GraphSolution solution = solution_with(rare);
  solution.least_sightings = 1;
  builder_->adopt(solution, kNow_utc_ns);
  EXPECT_NE(builder_->snapshot()->find(3), nullptr);
}

TEST_F(MapBuilderTest, DoesNotMoveSurveyedTags) {
  auto map = make_map({1, 2});
  map.tags[1].state = TagState::kSurveyed;
  start(map);
  see(2, 7.0);
  EXPECT_EQ(worst_corner_m(*builder_->snapshot(), map), 0);
  EXPECT_EQ(tag(2).state, TagState::kSurveyed);
}

TEST_F(MapBuilderTest, GivesFiltersAllUsableTags) {
  auto map = make_map({1, 2, 3});
  map.tags[1].state = TagState::kSurveyed;
  map.tags[2].state = TagState::kQuarantined;
  start(map);
  const auto known = [this] { return builder_->snapshot()->known; };
  EXPECT_EQ(known()->uncorrelated.size(), 2u) << "a map without correlations";
  EXPECT_FALSE(known()->is_joint(1));
  see(1);
  EXPECT_TRUE(known()->is_joint(1));
  EXPECT_FALSE(known()->is_joint(2));
  EXPECT_NE(known()->find(2), nullptr) << "surveyed";
  EXPECT_EQ(known()->find(3), nullptr) << "quarantined";
}

TEST_F(MapBuilderTest, NamesTheBodyThatAloneHasMadeTheMap) {
  const auto contribute = [this](int body_id) {
    builder_->absorb({.body_id = body_id, .segment = std::make_shared<const MotionSegment>()},
                     kNow_utc_ns);
    see(3);
    return builder_->snapshot()->known->made_by;
  };
  EXPECT_EQ(contribute(4), std::nullopt) << "it has begun with a map";
  start(TagMap{});
  EXPECT_EQ(contribute(4), std::optional(4));
  start(*builder_->snapshot());
  EXPECT_EQ(builder_->snapshot()->known->made_by, std::nullopt) << "in an earlier session";
  start(TagMap{});
  (void)contribute(4);
  EXPECT_EQ(contribute(5), std::nullopt);
}

TEST_F(MapBuilderTest, DoesNotChangeAFrozenMap) {
  see(3);
  builder_->set_mode(MapMode::kFrozen);
  EXPECT_EQ(builder_->mode(), MapMode::kFrozen);
  const auto frozen = builder_->snapshot();
  see(3, 5.0);
  see(4);
  EXPECT_EQ(builder_->snapshot(), frozen);
  builder_->set_mode(MapMode::kMapping);
  see(4);
  EXPECT_NE(builder_->snapshot()->find(4), nullptr);
}

TEST_F(MapBuilderTest, HasTheVersionOfTheStoredMapAndKeepsLaterChanges) {
  see(3);
  store_as_12(*builder_->snapshot());
  EXPECT_FALSE(builder_->changed());
  EXPECT_EQ(builder_->snapshot()->version, 12);
  EXPECT_EQ(builder_->snapshot()->parent, 11);
  EXPECT_EQ(builder_->snapshot()->hash, "abc");
  see(4);
  EXPECT_TRUE(builder_->changed());
  EXPECT_EQ(builder_->snapshot()->version, 12);
  EXPECT_EQ(builder_->snapshot()->hash, "");
  const TagMap before = *builder_->snapshot();
  see(6);
  store_as_12(before);
  EXPECT_TRUE(builder_->changed()) << "since it was stored";
  EXPECT_NE(builder_->snapshot()->find(6), nullptr);
}

TEST_F(MapBuilderTest, GivesEachEventOnceAndLimitsTheirNumber) {
  see(3);
  EXPECT_THAT(builder_->take_events(),
              ElementsAre(event_of(MapEvent::Kind::kTagAdded, "tag 3 joined the map")));
  EXPECT_TRUE(builder_->take_events().empty());
  for (int id = 100; id < 500; ++id) see(id);
  const auto last = builder_->take_events();
  EXPECT_EQ(last.size(), 256u);
  EXPECT_EQ(last.back().tag_id, 499);
}

// For the thread sanitizer: workers, refinement, publisher and the store at the same time.
TEST_F(MapBuilderTest, MayBeUsedByWorkersAndReadersAtOnce) {
  const auto worker = [this](int body) {
    const int fitting[] = {2, 5};
    for (int i = 0; i < 300; ++i) {
      (void)builder_->view(body);
      builder_->absorb({.body_id = body,
                        .at = instant_from_ns(i),
                        .anchored = true,
                        .fitting = fitting,
                        .segment = std::make_shared<const MotionSegment>()},
                       kNow_utc_ns);
    }
  };
  std::thread first(worker, 1);
  std::thread second(worker, 2);
  std::thread refinement([this] {
    for (int i = 0; i < 300; ++i) {
      (void)builder_->take_segments();
      see(10 + i % 24, 1.0 + 0.001 * i);
    }
  });
  std::size_t tags = 0;
  for (int i = 0; i < 300; ++i) {
    tags = std::max(tags, builder_->snapshot()->tags.size());
    if (i % 50 == 0) builder_->mark_stored(*builder_->snapshot());
  }
  first.join();
  second.join();
  refinement.join();
  EXPECT_LE(tags, 26u);
  EXPECT_EQ(builder_->snapshot()->tags.size(), 26u);
  EXPECT_EQ(fault_in(*builder_->snapshot()), std::nullopt);
}

/// The body that defines the workspace.
class WorkspaceTest : public MapBuilderTest {
 protected:
  WorkspaceTest() { start({}); }
  void start_with_reference(TagMap map) {
    map.reference_tag = 7;
    start(map);
  }
  void absorb_from(int body, bool anchored) {
    builder_->absorb({.body_id = body, .anchored = anchored}, kNow_utc_ns);
  }
  bool may_define(int body) { return builder_->view(body).may_define_workspace; }
};

TEST_F(WorkspaceTest, IsDefinedByTheFirstAnchoredBody) {
  EXPECT_TRUE(may_define(1));
  EXPECT_FALSE(may_define(2)) << "1 may define it";
  absorb_from(1, false);
  EXPECT_TRUE(may_define(2)) << "1 saw no tag";
  absorb_from(2, true);
  EXPECT_FALSE(may_define(1));
  EXPECT_TRUE(may_define(2)) << "after a reset, while the map is empty";
  absorb_from(2, true);
  see(7);
  EXPECT_FALSE(may_define(2)) << "the map defines it";
}

TEST_F(WorkspaceTest, IsFreeWhenItsBodyIsReleasedBeforeMapping) {
  (void)may_define(1);
  absorb_from(1, true);
  EXPECT_FALSE(may_define(2));
  builder_->release(1);
  EXPECT_TRUE(may_define(2));
}

TEST_F(WorkspaceTest, IsThatOfTheInitialMapWithoutReferenceTag) {
  start_with_reference(make_map({1, 2}));
  EXPECT_FALSE(may_define(1)) << "tags 1 and 2 define it";
}

TEST_F(WorkspaceTest, IsDefinedByAQuarantinedTagSeenAgain) {
  TagMap map = make_map({1});
  map.tags[0].state = TagState::kQuarantined;
  start(map);
  EXPECT_TRUE(may_define(1));
  see(1, 5.0);
  EXPECT_FALSE(may_define(1)) << "also not after a reset";
}

TEST_F(WorkspaceTest, IsTheReferenceTagUntilTheGraphHasASolution) {
  start_with_reference({});
  EXPECT_TRUE(may_define(1));
  EXPECT_TRUE(may_define(2));
  see(3, 0);
  EXPECT_FALSE(may_define(1));
  EXPECT_NE(builder_->snapshot()->known->find(3), nullptr);
}

}  // namespace
}  // namespace fiducap
