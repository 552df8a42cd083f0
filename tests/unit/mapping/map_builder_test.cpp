#include "mapping/map_builder.hpp"

#include <gtest/gtest.h>

#include <thread>

#include "unit/mapping/belief_fixture.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

class MapBuilderTest : public testing::Test {
 protected:
  MapBuilderTest() : builder_(kByBeliefs, make_map({2, 5})) {}
  void absorb(int body, const TagBelief& b) { builder_.absorb(from(body, b), kNow_utc_ns); }
  void contradict(int body, int tag_id, int second) {
    const int contradicted[] = {tag_id};
    builder_.absorb({.body_id = body,
                     .at = instant_from_ns(second * 1'000'000'000LL),
                     .anchored = true,
                     .contradicted = contradicted},
                    kNow_utc_ns);
  }
  MapBuilder builder_;
};

TEST_F(MapBuilderTest, StartsWithTheMapItWasGiven) {
  EXPECT_EQ(worst_corner_m(*builder_.snapshot(), make_map({2, 5})), 0);
  EXPECT_FALSE(builder_.changed());
}

TEST_F(MapBuilderTest, ABeliefBelowTheLimitsJoins) {
  const auto before = builder_.snapshot();
  absorb(1, belief(3));
  EXPECT_EQ(before->find(3), nullptr);  // a snapshot never changes
  const auto after = builder_.snapshot();
  const MapTag* joined = after->find(3);
  ASSERT_NE(joined, nullptr);
  EXPECT_EQ(joined->state, TagState::kLocal);
  EXPECT_EQ(joined->component, 0);
  EXPECT_EQ(joined->sightings, 20);
  EXPECT_EQ(joined->last_seen_utc_ns, kNow_utc_ns);
  EXPECT_EQ(joined->first_seen_utc_ns, kNow_utc_ns - 3'000'000'000);
  EXPECT_EQ(joined->tag.X_WT.p.x(), 1.0);
  EXPECT_EQ(after->created_utc_ns, kNow_utc_ns);
  EXPECT_TRUE(builder_.changed());
  EXPECT_EQ(fault_in(*after), std::nullopt);
}

TEST_F(MapBuilderTest, AnUncertainRareOrBrokenBeliefStaysOutside) {
  absorb(1, belief(3, 0.051));
  absorb(1, belief(3, 0.01, 1.0, 9));
  auto turned = belief(3);
  turned.tag.covariance(5, 5) = 0.051 * 0.051;
  absorb(1, turned);
  absorb(1, belief(3, std::numeric_limits<double>::quiet_NaN()));
  absorb(1, belief(3, 0.01, std::numeric_limits<double>::quiet_NaN()));
  absorb(1, belief(-3));
  EXPECT_EQ(builder_.snapshot()->tags.size(), 2u);
  EXPECT_FALSE(builder_.changed());
}

TEST_F(MapBuilderTest, TagsThatStartCalibratedOrSurveyedNeverMoveByBeliefsAlone) {
  auto start = make_map({1, 2});
  start.tags[1].state = TagState::kSurveyed;
  MapBuilder builder(kByBeliefs, start);
  for (const int id : {1, 2}) {
    const auto better = belief(id, 1e-6);
    builder.absorb(from(1, better), kNow_utc_ns);
  }
  EXPECT_EQ(worst_corner_m(*builder.snapshot(), start), 0);
  EXPECT_FALSE(builder.changed());
}

TEST_F(MapBuilderTest, ATagThatStartsQuarantinedIsLearnedAnew) {
  auto start = make_map({1, 2});
  start.tags[1].state = TagState::kQuarantined;
  MapBuilder builder(kByBeliefs, start);
  const auto anew = belief(2, 0.01, start.tags[1].tag.X_WT.p.x() + 1.5);
  builder.absorb(from(1, anew), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(2)->state, TagState::kLocal);
  EXPECT_EQ(builder.snapshot()->find(2)->tag.X_WT.p.x(), anew.tag.X_WT.p.x());
}

TEST_F(MapBuilderTest, ALocalTagOfTheStartingMapGoesToWhoKnowsItBetter) {
  auto start = make_map({1});
  start.tags[0].state = TagState::kLocal;
  start.tags[0].tag.covariance = Matrix6d::Identity() * 0.01 * 0.01;
  MapBuilder builder(kByBeliefs, start);
  const auto equal = belief(1, 0.01);
  builder.absorb(from(1, equal), kNow_utc_ns);
  EXPECT_NE(builder.snapshot()->find(1)->tag.X_WT.p.x(), 1.0);
  const auto better = belief(1, 0.005);
  builder.absorb(from(1, better), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(1)->tag.X_WT.p.x(), 1.0);
}

TEST_F(MapBuilderTest, AnotherBodyTakesOverOnlyWhenThirtyPercentBetter) {
  absorb(1, belief(3, 0.010, 1.0));
  absorb(2, belief(3, 0.009, 1.5));  // variance 0.81
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.X_WT.p.x(), 1.0);
  absorb(2, belief(3, 0.008, 1.5));  // variance 0.64
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.X_WT.p.x(), 1.5);
  absorb(1, belief(3, 0.0075, 1.0));  // variance 0.88 of the new owner's
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.X_WT.p.x(), 1.5);
}

TEST_F(MapBuilderTest, TheOwnerMovesItsTagUnlessItHasBecomeMuchWorse) {
  absorb(1, belief(3, 0.010, 1.0));
  absorb(1, belief(3, 0.011, 1.1));
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.X_WT.p.x(), 1.1);
  absorb(1, belief(3, 0.020, 2.0));  // the same body after its filter started again
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.X_WT.p.x(), 1.1);
}

TEST_F(MapBuilderTest, PublishesOnlyWhatCanBeSeen) {
  absorb(1, belief(3, 0.010, 1.0));
  const auto first = builder_.snapshot();
  absorb(1, belief(3, 0.010, 1.00006));
  EXPECT_EQ(builder_.snapshot(), first);
  absorb(1, belief(3, 0.010, 1.00011));  // together more than 0.1 mm: small steps do not hide
  EXPECT_NE(builder_.snapshot(), first);
  const auto second = builder_.snapshot();
  auto turned = belief(3, 0.010, 1.00011);
  turned.tag.X_WT.q = exp_so3({0, 0, 0.0001});
  absorb(1, turned);
  EXPECT_EQ(builder_.snapshot(), second);
  turned.tag.X_WT.q = exp_so3({0, 0, 0.0002});
  absorb(1, turned);
  EXPECT_NE(builder_.snapshot(), second);
  const auto third = builder_.snapshot();
  turned.tag.covariance *= 0.8;
  absorb(1, turned);
  EXPECT_NE(builder_.snapshot(), third);
}

TEST_F(MapBuilderTest, FrozenLeavesTheMapAlone) {
  absorb(1, belief(3));
  builder_.set_mode(MapMode::kFrozen);
  EXPECT_EQ(builder_.mode(), MapMode::kFrozen);
  const auto frozen = builder_.snapshot();
  absorb(1, belief(3, 0.001, 5.0));
  absorb(1, belief(4));
  EXPECT_EQ(builder_.snapshot(), frozen);
  builder_.set_mode(MapMode::kMapping);
  absorb(1, belief(4));
  EXPECT_NE(builder_.snapshot()->find(4), nullptr);
}

TEST_F(MapBuilderTest, AStoredMapIsNotChangedAndCarriesItsVersion) {
  absorb(1, belief(3));
  auto stored = *builder_.snapshot();
  stored.version = 12;
  stored.parent = 11;
  stored.hash = "abc";
  builder_.mark_stored(stored);
  EXPECT_FALSE(builder_.changed());
  EXPECT_EQ(builder_.snapshot()->version, 12);
  EXPECT_EQ(builder_.snapshot()->parent, 11);
  EXPECT_EQ(builder_.snapshot()->hash, "abc");
  absorb(1, belief(4));
  EXPECT_TRUE(builder_.changed());
  EXPECT_EQ(builder_.snapshot()->version, 12);
  EXPECT_EQ(builder_.snapshot()->hash, "");
}

TEST_F(MapBuilderTest, WhatJoinsWhileTheStoreWritesIsStillChanged) {
  absorb(1, belief(3));
  auto stored = *builder_.snapshot();
  stored.version = 12;
  stored.hash = "abc";
  absorb(1, belief(4));
  builder_.mark_stored(stored);
  EXPECT_TRUE(builder_.changed());
  EXPECT_EQ(builder_.snapshot()->version, 12);
  EXPECT_EQ(builder_.snapshot()->hash, "");
  EXPECT_NE(builder_.snapshot()->find(4), nullptr);
}

TEST_F(MapBuilderTest, TellsWhatHappenedOnce) {
  absorb(1, belief(3, 0.01));
  absorb(2, belief(3, 0.001));
  const auto events = builder_.take_events();
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].kind, MapEvent::Kind::kTagAdded);
  EXPECT_EQ(events[0].tag_id, 3);
  EXPECT_EQ(events[1].kind, MapEvent::Kind::kTagRefined);
  EXPECT_EQ(events[1].text, "tag 3 is known better by body 2");
  EXPECT_TRUE(builder_.take_events().empty());
}

TEST_F(MapBuilderTest, KeepsABoundedNumberOfEvents) {
  for (int id = 100; id < 500; ++id) absorb(1, belief(id));
  const auto events = builder_.take_events();
  EXPECT_EQ(events.size(), 256u);
  EXPECT_EQ(events.back().tag_id, 499);
}

TEST(MapConfig, NamesEveryBrokenRule) {
  EXPECT_TRUE(MapConfig{}.check().empty());
  MapConfig config;
  config.publish_sightings = 0;
  config.commit_period_s = -1;
  const auto errors = config.check();
  ASSERT_EQ(errors.size(), 2u);
  EXPECT_EQ(errors[0].path, "map.publish_sightings");
  EXPECT_EQ(errors[1].text(), "map.commit_period_s = -1: must be finite and > 0");
}

// Meant for the thread sanitizer: workers, publisher and the store at the same time.
TEST_F(MapBuilderTest, WorkersAndReadersMayEnterTogether) {
  const auto worker = [this](int body) {
    for (int i = 0; i < 300; ++i)
      absorb(body, belief(10 + i % 24, 0.01 / (1 + i), 1.0 + 0.001 * i));
  };
  std::thread first(worker, 1);
  std::thread second(worker, 2);
  std::size_t tags = 0;
  for (int i = 0; i < 300; ++i) {
    tags = std::max(tags, builder_.snapshot()->tags.size());
    if (i % 50 == 0) builder_.mark_stored(*builder_.snapshot());
  }
  first.join();
  second.join();
  EXPECT_LE(tags, 26u);
  EXPECT_EQ(builder_.snapshot()->tags.size(), 26u);
  EXPECT_EQ(fault_in(*builder_.snapshot()), std::nullopt);
}

TEST_F(MapBuilderTest, ABeliefInAxesOfTheBodysOwnStaysOutside) {
  auto own = belief(3);
  own.component = TagBelief::kOwnAxes;
  absorb(1, own);
  EXPECT_EQ(builder_.snapshot()->find(3), nullptr);
}

TEST_F(MapBuilderTest, ARoundingErrorBelowZeroDoesNotKeepTheReferenceTagOut) {
  auto exact = belief(3);
  exact.tag.covariance(0, 0) = -1e-21;  // what tying the workspace to the tag leaves
  absorb(1, exact);
  ASSERT_NE(builder_.snapshot()->find(3), nullptr);
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.covariance(0, 0), 0);
  auto broken = belief(4);
  broken.tag.covariance(0, 0) = -1e-6;
  absorb(1, broken);
  EXPECT_EQ(builder_.snapshot()->find(4), nullptr);
}

TEST_F(MapBuilderTest, AContradictedTagIsLeftOutUntilItWasLearnedAnew) {
  absorb(1, belief(3, 0.01, 1.0));
  const int moved[] = {3};
  builder_.absorb({.body_id = 1, .at = instant_from_ns(9'000'000'000), .contradicted = moved},
                  kNow_utc_ns);
  TagObservations seen;
  seen.tags.resize(1);
  seen.tags[0].tag_id = 3;
  std::vector<KnownTag> known;
  builder_.snapshot()->known_among(seen, known);
  EXPECT_TRUE(known.empty());
  absorb(2, belief(3, 0.001, 1.0));  // seen before it moved
  EXPECT_EQ(builder_.snapshot()->find(3)->state, TagState::kQuarantined);
  auto anew = belief(3, 0.04, 1.5);
  anew.last_seen = instant_from_ns(12'000'000'000);
  absorb(1, anew);
  EXPECT_EQ(builder_.snapshot()->find(3)->state, TagState::kLocal);
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.X_WT.p.x(), 1.5);
  bool told = false;
  for (const MapEvent& event : builder_.take_events())
    told |=
        event.kind == MapEvent::Kind::kTagMoved && event.text.find("0.500 m") != std::string::npos;
  EXPECT_TRUE(told);
}

TEST_F(MapBuilderTest, ATagThatMovedByLessThanADecimetreStaysAndThatIsSaid) {
  absorb(1, belief(3, 0.01, 1.0));
  contradict(2, 3, 9);
  (void)builder_.take_events();
  auto nearby = belief(3, 0.001, 1.023);
  nearby.last_seen = instant_from_ns(12'000'000'000);
  absorb(2, nearby);
  EXPECT_EQ(builder_.snapshot()->find(3)->state, TagState::kLocal);
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.X_WT.p.x(), 1.0);
  const std::vector<MapEvent> events = builder_.take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].kind, MapEvent::Kind::kTagDisputed);
  EXPECT_NE(events[0].text.find("0.023 m"), std::string::npos) << events[0].text;
  absorb(2, nearby);
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.X_WT.p.x(), 1.0) << "also for the next belief";
  contradict(2, 3, 15);
  EXPECT_EQ(builder_.snapshot()->find(3)->state, TagState::kLocal) << "just looked into";
  EXPECT_TRUE(builder_.take_events().empty());
}

TEST_F(MapBuilderTest, ADisputedTagThatIsMovedLaterIsLearnedAnew) {
  absorb(1, belief(3, 0.01, 1.0));
  contradict(2, 3, 9);
  auto nearby = belief(3, 0.001, 1.023);
  nearby.last_seen = instant_from_ns(12'000'000'000);
  absorb(2, nearby);
  (void)builder_.take_events();
  contradict(2, 3, 100);
  EXPECT_EQ(builder_.snapshot()->find(3)->state, TagState::kQuarantined);
  auto moved = belief(3, 0.01, 2.0);
  moved.last_seen = instant_from_ns(103'000'000'000);
  absorb(2, moved);
  EXPECT_EQ(builder_.snapshot()->find(3)->tag.X_WT.p.x(), 2.0);
  const std::vector<MapEvent> events = builder_.take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].kind, MapEvent::Kind::kTagMoved);
}

TEST_F(MapBuilderTest, ACalibratedTagIsCalibratedAgainAfterADispute) {
  const double x = builder_.snapshot()->find(2)->tag.X_WT.p.x();
  auto nearby = belief(2, 0.001, 0);
  nearby.tag.X_WT = builder_.snapshot()->find(2)->tag.X_WT;
  nearby.tag.X_WT.p.x() += 0.02;
  contradict(1, 2, 3);
  absorb(1, nearby);
  EXPECT_EQ(builder_.snapshot()->find(2)->state, TagState::kCalibrated);
  absorb(1, nearby);
  EXPECT_EQ(builder_.snapshot()->find(2)->tag.X_WT.p.x(), x);
}

TEST_F(MapBuilderTest, AFrozenMapSaysOnceWhichTagIsContradicted) {
  builder_.set_mode(MapMode::kFrozen);
  for (int second = 1; second < 200; second += 10) contradict(1, 2, second);
  EXPECT_NE(builder_.snapshot()->find(2)->state, TagState::kQuarantined);
  const std::vector<MapEvent> events = builder_.take_events();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_NE(events[0].text.find("frozen"), std::string::npos) << events[0].text;
}

TEST_F(MapBuilderTest, ASurveyedTagIsNeverMovedByAContradiction) {
  auto start = make_map({1});
  start.tags[0].state = TagState::kSurveyed;
  MapBuilder builder(kByBeliefs, start);
  const int moved[] = {1};
  for (int times = 0; times < 3; ++times)
    builder.absorb({.body_id = 1, .contradicted = moved}, kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(1)->state, TagState::kSurveyed);
  ASSERT_EQ(builder.take_events().size(), 1u) << "but it is said, once";
}

TEST_F(MapBuilderTest, ATagThatIsLookedAtAndStaysHasSettled) {
  for (int s = 0; s <= 12; ++s) {
    auto b = belief(3, 0.01, 1.0, 50 + 10 * s);
    b.last_seen = instant_from_ns((4 + s) * 1'000'000'000LL);
    absorb(1, b);
  }
  EXPECT_EQ(builder_.snapshot()->find(3)->state, TagState::kCalibrated);
}

}  // namespace
}  // namespace fiducap
