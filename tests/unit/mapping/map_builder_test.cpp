#include "mapping/map_builder.hpp"

#include <gmock/gmock.h>

#include <optional>
#include <thread>

#include "unit/mapping/belief_fixture.hpp"

namespace fiducap {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;

TagBelief seen_at(int second, TagBelief b) {
  b.last_seen = instant_from_ns(second * 1'000'000'000LL);
  return b;
}

class MapBuilderTest : public testing::Test {
 protected:
  MapBuilderTest() { start(make_map({2, 5})); }
  void start(const TagMap& map) { builder_.emplace(kByBeliefs, map); }
  void absorb(int body, const TagBelief& b) { builder_->absorb(from(body, b), kNow_utc_ns); }
  void contradict(int body, int tag_id, int second) {
    const int contradicted[] = {tag_id};
    builder_->absorb({.body_id = body,
                      .at = instant_from_ns(second * 1'000'000'000LL),
                      .anchored = true,
                      .contradicted = contradicted},
                     kNow_utc_ns);
  }
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

TEST_F(MapBuilderTest, AddsABeliefBelowTheLimits) {
  const auto before = builder_->snapshot();
  absorb(1, belief(3));
  EXPECT_EQ(before->find(3), nullptr);  // a snapshot never changes
  const auto after = builder_->snapshot();
  const MapTag* joined = after->find(3);
  ASSERT_NE(joined, nullptr);
  EXPECT_EQ(joined->state, TagState::kLocal);
  EXPECT_EQ(joined->component, 0);
  EXPECT_EQ(joined->sightings, 20);
  EXPECT_EQ(joined->last_seen_utc_ns, kNow_utc_ns);
  EXPECT_EQ(joined->first_seen_utc_ns, kNow_utc_ns - 3'000'000'000);
  EXPECT_EQ(joined->tag.X_WT.p.x(), 1.0);
  EXPECT_EQ(after->created_utc_ns, kNow_utc_ns);
  EXPECT_TRUE(builder_->changed());
  EXPECT_EQ(fault_in(*after), std::nullopt);
}

TEST_F(MapBuilderTest, RefusesUncertainRareAndInvalidBeliefs) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  auto turned = belief(3);
  turned.tag.covariance(5, 5) = 0.051 * 0.051;
  auto own = belief(3);
  own.component = TagBelief::kOwnAxes;
  for (const TagBelief& bad : {belief(3, 0.051), belief(3, 0.01, 1.0, 9), turned, belief(3, kNan),
                               belief(3, 0.01, kNan), belief(-3), own})
    absorb(1, bad);
  EXPECT_EQ(builder_->snapshot()->tags.size(), 2u);
  EXPECT_FALSE(builder_->changed());
}

TEST_F(MapBuilderTest, DoesNotMoveCalibratedAndSurveyedTags) {
  auto map = make_map({1, 2});
  map.tags[1].state = TagState::kSurveyed;
  start(map);
  for (const int id : {1, 2}) absorb(1, belief(id, 1e-6));
  EXPECT_EQ(worst_corner_m(*builder_->snapshot(), map), 0);
  EXPECT_FALSE(builder_->changed());
}

TEST_F(MapBuilderTest, MapsAQuarantinedTagAgain) {
  auto map = make_map({1, 2});
  map.tags[1].state = TagState::kQuarantined;
  start(map);
  absorb(1, belief(2, 0.01, 7.5));
  EXPECT_EQ(tag(2).state, TagState::kLocal);
  EXPECT_EQ(x_of(2), 7.5);
}

TEST_F(MapBuilderTest, ReplacesALocalTagByABetterBelief) {
  auto map = make_map({1});
  map.tags[0].state = TagState::kLocal;
  map.tags[0].tag.covariance = Matrix6d::Identity() * 0.01 * 0.01;
  start(map);
  absorb(1, belief(1, 0.01));
  EXPECT_NE(x_of(1), 1.0);
  absorb(1, belief(1, 0.005));
  EXPECT_EQ(x_of(1), 1.0);
}

TEST_F(MapBuilderTest, ChangesTheOwnerWhenBetterAndMovesItsTags) {
  absorb(1, belief(3, 0.010, 1.0));
  absorb(2, belief(3, 0.009, 1.5));  // variance 0.81
  EXPECT_EQ(x_of(3), 1.0);
  absorb(2, belief(3, 0.008, 1.5));  // variance 0.64
  EXPECT_EQ(x_of(3), 1.5);
  absorb(1, belief(3, 0.0075, 1.0));  // variance 0.88 of the new owner's
  EXPECT_EQ(x_of(3), 1.5);
  absorb(1, belief(4, 0.010, 1.0));
  absorb(1, belief(4, 0.011, 1.1));
  EXPECT_EQ(x_of(4), 1.1);
  absorb(1, belief(4, 0.020, 2.0));  // the same body after its filter started again
  EXPECT_EQ(x_of(4), 1.1);
}

TEST_F(MapBuilderTest, PublishesSignificantChangesOnly) {
  absorb(1, belief(3, 0.010, 1.0));
  const auto first = builder_->snapshot();
  absorb(1, belief(3, 0.010, 1.00006));
  EXPECT_EQ(builder_->snapshot(), first);
  absorb(1, belief(3, 0.010, 1.00011));  // together more than 0.1 mm
  EXPECT_NE(builder_->snapshot(), first);
  const auto second = builder_->snapshot();
  auto turned = belief(3, 0.010, 1.00011);
  turned.tag.X_WT.q = exp_so3({0, 0, 0.0001});
  absorb(1, turned);
  EXPECT_EQ(builder_->snapshot(), second);
  turned.tag.X_WT.q = exp_so3({0, 0, 0.0002});
  absorb(1, turned);
  EXPECT_NE(builder_->snapshot(), second);
  const auto third = builder_->snapshot();
  turned.tag.covariance *= 0.8;
  absorb(1, turned);
  EXPECT_NE(builder_->snapshot(), third);
}

TEST_F(MapBuilderTest, DoesNotChangeAFrozenMap) {
  absorb(1, belief(3));
  builder_->set_mode(MapMode::kFrozen);
  EXPECT_EQ(builder_->mode(), MapMode::kFrozen);
  const auto frozen = builder_->snapshot();
  absorb(1, belief(3, 0.001, 5.0));
  absorb(1, belief(4));
  EXPECT_EQ(builder_->snapshot(), frozen);
  builder_->set_mode(MapMode::kMapping);
  absorb(1, belief(4));
  EXPECT_NE(builder_->snapshot()->find(4), nullptr);
}

TEST_F(MapBuilderTest, HasTheVersionOfTheStoredMapAndKeepsLaterChanges) {
  absorb(1, belief(3));
  store_as_12(*builder_->snapshot());
  EXPECT_FALSE(builder_->changed());
  EXPECT_EQ(builder_->snapshot()->version, 12);
  EXPECT_EQ(builder_->snapshot()->parent, 11);
  EXPECT_EQ(builder_->snapshot()->hash, "abc");
  absorb(1, belief(4));
  EXPECT_TRUE(builder_->changed());
  EXPECT_EQ(builder_->snapshot()->version, 12);
  EXPECT_EQ(builder_->snapshot()->hash, "");
  const TagMap before = *builder_->snapshot();
  absorb(1, belief(6));
  store_as_12(before);
  EXPECT_TRUE(builder_->changed()) << "since it was stored";
  EXPECT_NE(builder_->snapshot()->find(6), nullptr);
}

TEST_F(MapBuilderTest, GivesEachEventOnceAndLimitsTheirNumber) {
  absorb(1, belief(3, 0.01));
  absorb(2, belief(3, 0.001));
  const auto events = builder_->take_events();
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].kind, MapEvent::Kind::kTagAdded);
  EXPECT_EQ(events[0].tag_id, 3);
  EXPECT_EQ(events[1].kind, MapEvent::Kind::kTagRefined);
  EXPECT_EQ(events[1].text, "tag 3 is known better by body 2");
  EXPECT_TRUE(builder_->take_events().empty());
  for (int id = 100; id < 500; ++id) absorb(1, belief(id));
  const auto last = builder_->take_events();
  EXPECT_EQ(last.size(), 256u);
  EXPECT_EQ(last.back().tag_id, 499);
}

// For the thread sanitizer: workers, publisher and the store at the same time.
TEST_F(MapBuilderTest, MayBeUsedByWorkersAndReadersAtOnce) {
  const auto worker = [this](int body) {
    for (int i = 0; i < 300; ++i)
      absorb(body, belief(10 + i % 24, 0.01 / (1 + i), 1.0 + 0.001 * i));
  };
  std::thread first(worker, 1);
  std::thread second(worker, 2);
  std::size_t tags = 0;
  for (int i = 0; i < 300; ++i) {
    tags = std::max(tags, builder_->snapshot()->tags.size());
    if (i % 50 == 0) builder_->mark_stored(*builder_->snapshot());
  }
  first.join();
  second.join();
  EXPECT_LE(tags, 26u);
  EXPECT_EQ(builder_->snapshot()->tags.size(), 26u);
  EXPECT_EQ(fault_in(*builder_->snapshot()), std::nullopt);
}

TEST_F(MapBuilderTest, AcceptsRoundingErrorsOfTheReferenceTag) {
  auto exact = belief(3);
  exact.tag.covariance(0, 0) = -1e-21;  // rounding of the reference tag
  absorb(1, exact);
  ASSERT_NE(builder_->snapshot()->find(3), nullptr);
  EXPECT_EQ(tag(3).tag.covariance(0, 0), 0);
  auto broken = belief(4);
  broken.tag.covariance(0, 0) = -1e-6;
  absorb(1, broken);
  EXPECT_EQ(builder_->snapshot()->find(4), nullptr);
}

TEST_F(MapBuilderTest, ExcludesAContradictedTagUntilItIsMappedAgain) {
  absorb(1, belief(3, 0.01, 1.0));
  contradict(1, 3, 9);
  TagObservations seen;
  seen.tags.resize(1);
  seen.tags[0].tag_id = 3;
  std::vector<KnownTag> known;
  builder_->snapshot()->known_among(seen, known);
  EXPECT_TRUE(known.empty());
  absorb(2, belief(3, 0.001, 1.0));  // seen before it moved
  EXPECT_EQ(tag(3).state, TagState::kQuarantined);
  absorb(1, seen_at(12, belief(3, 0.04, 1.5)));
  EXPECT_EQ(tag(3).state, TagState::kLocal);
  EXPECT_EQ(x_of(3), 1.5);
  EXPECT_THAT(builder_->take_events(), Contains(event_of(MapEvent::Kind::kTagMoved, "0.500 m")));
}

TEST_F(MapBuilderTest, KeepsATagThatMovedByCentimetres) {
  absorb(1, belief(3, 0.01, 1.0));
  contradict(2, 3, 9);
  (void)builder_->take_events();
  const TagBelief nearby = seen_at(12, belief(3, 0.001, 1.023));
  absorb(2, nearby);
  EXPECT_EQ(tag(3).state, TagState::kLocal);
  EXPECT_EQ(x_of(3), 1.0);
  EXPECT_THAT(builder_->take_events(),
              ElementsAre(event_of(MapEvent::Kind::kTagDisputed, "0.023 m")));
  absorb(2, nearby);
  EXPECT_EQ(x_of(3), 1.0) << "with the next belief, too";
  contradict(2, 3, 15);
  EXPECT_EQ(tag(3).state, TagState::kLocal) << "tested recently";
  EXPECT_TRUE(builder_->take_events().empty());
}

TEST_F(MapBuilderTest, MapsADisputedTagThatMovesLater) {
  absorb(1, belief(3, 0.01, 1.0));
  contradict(2, 3, 9);
  const TagBelief nearby = seen_at(12, belief(3, 0.001, 1.023));
  absorb(2, nearby);
  (void)builder_->take_events();
  contradict(2, 3, 100);
  EXPECT_EQ(tag(3).state, TagState::kQuarantined);
  absorb(2, seen_at(103, belief(3, 0.01, 2.0)));
  EXPECT_EQ(x_of(3), 2.0);
  EXPECT_THAT(builder_->take_events(), ElementsAre(event_of(MapEvent::Kind::kTagMoved)));
}

TEST_F(MapBuilderTest, RestoresTheStateAfterADispute) {
  const double x = x_of(2);
  auto nearby = belief(2, 0.001, 0);
  nearby.tag.X_WT = tag(2).tag.X_WT;
  nearby.tag.X_WT.p.x() += 0.02;
  contradict(1, 2, 3);
  absorb(1, nearby);
  EXPECT_EQ(tag(2).state, TagState::kCalibrated);
  absorb(1, nearby);
  EXPECT_EQ(x_of(2), x);
}

TEST_F(MapBuilderTest, ReportsAContradictionOnceWhenFrozen) {
  builder_->set_mode(MapMode::kFrozen);
  for (int second = 1; second < 200; second += 10) contradict(1, 2, second);
  EXPECT_NE(tag(2).state, TagState::kQuarantined);
  EXPECT_THAT(builder_->take_events(), ElementsAre(Field(&MapEvent::text, HasSubstr("frozen"))));
}

TEST_F(MapBuilderTest, KeepsAContradictedSurveyedTag) {
  auto map = make_map({1});
  map.tags[0].state = TagState::kSurveyed;
  start(map);
  for (int times = 0; times < 3; ++times) contradict(1, 1, 0);
  EXPECT_EQ(tag(1).state, TagState::kSurveyed);
  EXPECT_EQ(builder_->take_events().size(), 1u);
}

TEST_F(MapBuilderTest, CalibratesAStableTag) {
  for (int s = 0; s <= 12; ++s) {
    absorb(1, seen_at(4 + s, belief(3, 0.01, 1.0, 50 + 10 * s)));
  }
  EXPECT_EQ(tag(3).state, TagState::kCalibrated);
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
  absorb(2, belief(7));
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
  absorb(1, belief(1, 0.01, 5.0));
  EXPECT_FALSE(may_define(1)) << "also not after a reset";
}

TEST_F(WorkspaceTest, IsTheReferenceTagUntilItIsMapped) {
  start_with_reference({});
  EXPECT_TRUE(may_define(1));
  EXPECT_TRUE(may_define(2));
  absorb(2, belief(7));
  EXPECT_FALSE(may_define(1));
}

TEST_F(WorkspaceTest, IsThatOfTheGraphOnceItHasASolution) {
  start_with_reference({});
  EXPECT_TRUE(may_define(1));
  GraphSolution solution;
  solution.tags.push_back(graph_estimate(3, 0));
  (void)builder_->adopt(solution, 0);
  EXPECT_FALSE(may_define(1));
  ASSERT_NE(builder_->snapshot()->known, nullptr);
  EXPECT_NE(builder_->snapshot()->known->find(3), nullptr);
}

}  // namespace
}  // namespace fiducap
