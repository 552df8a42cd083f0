// A map with a graph, and tags that leave their places.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/pose.hpp"
#include "mapping/map_builder.hpp"
#include "unit/mapping/belief_fixture.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

constexpr int kMoved = 7;
constexpr double kSigma = 0.002;
const std::vector<int> kOthers{2, 3};

Instant at(int second) { return instant_from_ns(second * 1'000'000'000LL); }

GraphTagEstimate estimate(int tag_id, double x, int epoch = 0) {
  GraphTagEstimate out;
  out.tag_id = tag_id;
  out.edge_m = 0.2;
  out.sightings = 200;
  out.first_seen = at(1);
  out.last_seen = at(10);
  out.X_WT.p.x() = x;
  out.covariance = Matrix6d::Identity() * kSigma * kSigma;
  out.epoch = epoch;
  return out;
}

class MapMovesTest : public testing::Test {
 protected:
  MapMovesTest() : builder_({.refine_period_s = 2}, TagMap{}) {
    adopt({estimate(kMoved, 1)});
    (void)builder_.take_events();
  }

  /// The tags that are not moved, and these.
  void adopt(const std::vector<GraphTagEstimate>& tags) {
    GraphSolution solution;
    for (const int tag_id : kOthers) solution.tags.push_back(estimate(tag_id, tag_id));
    for (const GraphTagEstimate& tag : tags) solution.tags.push_back(tag);
    for (const int tag_id : kOthers) solution.pairs.push_back({tag_id, kMoved, Matrix6d::Zero()});
    builder_.adopt(std::move(solution), kNow_utc_ns);
  }

  void contradict(int second, const std::vector<int>& contradicted = {kMoved},
                  const std::vector<int>& fitting = kOthers) {
    builder_.absorb({.body_id = 1,
                     .at = at(second),
                     .anchored = true,
                     .contradicted = contradicted,
                     .fitting = fitting},
                    kNow_utc_ns);
  }
  /// As many words as it takes …
  void notice(int second) {
    for (int i = 0; i < 3; ++i) contradict(second);
  }
  /// … and a solution that has it elsewhere.
  void move(int second, double x, int epoch) {
    notice(second);
    adopt({estimate(kMoved, x, epoch)});
  }

  [[nodiscard]] TagState state() const { return builder_.snapshot()->find(kMoved)->state; }
  [[nodiscard]] bool is_known() const {
    return builder_.snapshot()->known->find(kMoved) != nullptr;
  }

  MapBuilder builder_;
};

TEST_F(MapMovesTest, ATagThatIsGoneIsNotUsedAnyMore) {
  contradict(20, {}, {2, kMoved});
  const auto revision = builder_.published().revision;
  contradict(22);
  contradict(22);
  EXPECT_EQ(state(), TagState::kCalibrated);
  contradict(23);
  EXPECT_EQ(state(), TagState::kQuarantined);
  EXPECT_FALSE(is_known());
  EXPECT_TRUE(builder_.snapshot()->known->pairs.empty());
  EXPECT_EQ(builder_.published().revision, revision + 1);
  EXPECT_EQ(builder_.snapshot()->known->revision, revision + 1) << "filters notice";
  const auto moves = builder_.take_segments().moves;
  ASSERT_EQ(moves.size(), 1U);
  EXPECT_EQ(moves[0].tag_id, kMoved);
  EXPECT_EQ(moves[0].opens->gone, at(20));
  EXPECT_EQ(moves[0].opens->back, at(23));
  EXPECT_TRUE(builder_.take_segments().moves.empty());
  const auto events = builder_.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].kind, MapEvent::Kind::kTagQuarantined);
  EXPECT_THAT(events[0].text, HasSubstr("between 22:14:57 and 22:15:00 UTC, seen by body 1"));
}

TEST_F(MapMovesTest, AtItsNewPlaceItIsUsedAgainAndTheMapSaysHowFarItWasMoved) {
  notice(23);
  adopt({estimate(kMoved, 1)});
  EXPECT_EQ(state(), TagState::kQuarantined) << "of before it was known to have moved";
  EXPECT_EQ(builder_.snapshot()->find(kMoved)->tag.X_WT.p.x(), 1);
  auto young = estimate(kMoved, 1.3, 1);
  young.sightings = 12;
  adopt({young});
  EXPECT_EQ(state(), TagState::kQuarantined) << "hardly seen";
  (void)builder_.take_events();
  auto moved = estimate(kMoved, 1.3, 1);
  moved.X_WT.q = exp_so3({0, 0, 0.0717});
  adopt({moved});
  EXPECT_EQ(state(), TagState::kCalibrated);
  EXPECT_TRUE(is_known());
  EXPECT_EQ(builder_.snapshot()->find(kMoved)->tag.X_WT.p.x(), 1.3);
  const auto events = builder_.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].kind, MapEvent::Kind::kTagMoved);
  EXPECT_THAT(events[0].text, HasSubstr("tag 7 was moved by 300 mm and 4.1° between"));
  EXPECT_THAT(events[0].text, HasSubstr("seen by body 1"));
}

TEST_F(MapMovesTest, ATagThatIsFoundWhereItWasIsDisputedAndItsSightingsAreUnited) {
  notice(23);
  (void)builder_.take_segments();
  (void)builder_.take_events();
  adopt({estimate(kMoved, 1), estimate(kMoved, 1 + kSigma, 1)});
  EXPECT_EQ(state(), TagState::kCalibrated);
  const auto events = builder_.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].kind, MapEvent::Kind::kTagDisputed);
  EXPECT_THAT(events[0].text, HasSubstr("is in its old place"));
  const auto moves = builder_.take_segments().moves;
  ASSERT_EQ(moves.size(), 1U);
  EXPECT_FALSE(moves[0].opens);
  for (int second = 24; second < 60; ++second) contradict(second);
  EXPECT_EQ(state(), TagState::kCalibrated) << "for a minute nobody is believed about it";
}

TEST_F(MapMovesTest, WhatTheGraphHasLearnedOfTheOldPlaceCounts) {
  notice(23);
  adopt({estimate(kMoved, 1.05), estimate(kMoved, 1.05 + kSigma, 1)});
  EXPECT_EQ(builder_.take_events().back().kind, MapEvent::Kind::kTagDisputed);
}

TEST_F(MapMovesTest, ATagThatIsFoundAtTwoPlacesInTurnIsGivenUp) {
  move(22, 1.5, 1);
  move(32, 1.0, 2);
  EXPECT_EQ(state(), TagState::kCalibrated);
  (void)builder_.take_segments();
  notice(53);
  EXPECT_EQ(state(), TagState::kQuarantined);
  EXPECT_EQ(builder_.take_segments().moves.at(0).opens->back, Instant::max());
  const std::string text = builder_.take_events().back().text;
  EXPECT_THAT(text, HasSubstr("is not used any more"));
  EXPECT_THAT(text,
              HasSubstr("(1.00 0.00 0.00) and (1.50 0.00 0.00), 0.50 m apart: two printed tags"));
  move(62, 1.5, 3);
  EXPECT_EQ(state(), TagState::kQuarantined) << "for good";
  EXPECT_TRUE(builder_.take_events().empty());
}

TEST_F(MapMovesTest, ATagThatComesBackIsSaidToAndKeepsTheSightingsOfItsOtherPlace) {
  notice(22);
  auto open = estimate(kMoved, 1.5, 1);
  open.last_seen = at(31);
  adopt({estimate(kMoved, 1), open});
  (void)builder_.take_segments();
  notice(32);  // it was not found there since
  EXPECT_EQ(builder_.take_segments().moves.at(0).opens->gone, at(31));
  adopt({estimate(kMoved, 1), open, estimate(kMoved, 1, 2)});
  EXPECT_THAT(builder_.take_events().back().text, HasSubstr(", back to a place it had left"));
}

TEST_F(MapMovesTest, ATagThatIsNeverStillIsGivenUp) {
  for (int second = 22; second < 30; ++second) notice(second);
  EXPECT_THAT(builder_.take_events().back().text, HasSubstr("something that moves"));
}

TEST_F(MapMovesTest, ABodyThatWentAstrayTakesNothingOutOfTheMap) {
  for (int second = 20; second < 90; ++second) contradict(second, {kOthers[0], kMoved}, {3});
  for (const MapTag& tag : builder_.snapshot()->tags) EXPECT_EQ(tag.state, TagState::kCalibrated);
  EXPECT_TRUE(builder_.take_events().empty());
}

TEST_F(MapMovesTest, AFrozenMapSaysItOnceAndStays) {
  builder_.set_mode(MapMode::kFrozen);
  const auto before = builder_.snapshot();
  for (int second = 22; second < 60; ++second) contradict(second);
  EXPECT_EQ(builder_.snapshot(), before);
  EXPECT_TRUE(builder_.take_segments().moves.empty());
  const auto events = builder_.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].kind, MapEvent::Kind::kTagDisputed);
  EXPECT_THAT(events[0].text, HasSubstr("frozen"));
}

TEST_F(MapMovesTest, ASurveyedTagStays) {
  TagMap start;
  start.tags.push_back({.tag = belief(kMoved).tag, .state = TagState::kSurveyed});
  MapBuilder builder({.refine_period_s = 2}, start);
  const std::vector<int> moved{kMoved};
  for (int second = 22; second < 60; ++second) {
    builder.absorb({.body_id = 1,
                    .at = at(second),
                    .anchored = true,
                    .contradicted = moved,
                    .fitting = kOthers},
                   kNow_utc_ns);
  }
  EXPECT_EQ(builder.snapshot()->find(kMoved)->state, TagState::kSurveyed);
  ASSERT_EQ(builder.take_events().size(), 1U);
}

/// A map as a session with a graph has stored it.
TagMap map_with_ties() {
  TagMap map;
  auto known = std::make_shared<KnownMap>();
  known->revision = 1;
  const GraphTagEstimate tag = estimate(kMoved, 1);
  known->tags.push_back({tag.tag_id, tag.edge_m, tag.X_WT, tag.covariance});
  map.tags.push_back({.tag = known->tags.back(), .state = TagState::kCalibrated});
  map.known = std::move(known);
  return map;
}

TEST(MapMoves, StoredTiesAreKeptWhereAGraphKeepsThemTrueAndDroppedElsewhere) {
  const MapBuilder with_graph({.refine_period_s = 2}, map_with_ties());
  EXPECT_NE(with_graph.snapshot()->known, nullptr);
  const MapBuilder with_beliefs({.refine_period_s = 0}, map_with_ties());
  EXPECT_EQ(with_beliefs.snapshot()->known, nullptr);
  EXPECT_NE(with_beliefs.snapshot()->find(kMoved), nullptr);
}

TEST(MapMoves, EveryChangeOfStoredTiesIsNewsForFilters) {
  MapBuilder builder({.refine_period_s = 2}, map_with_ties());
  const auto before = builder.snapshot()->known->revision;
  GraphSolution solution;
  solution.tags.push_back(estimate(kMoved, 1.1));
  builder.adopt(std::move(solution), kNow_utc_ns);
  EXPECT_GT(builder.snapshot()->known->revision, before);
}

TEST(MapMoves, ATagQuarantinedInAnEarlierSessionIsUsedOnceTheGraphHasIt) {
  TagMap start;
  start.tags.push_back({.tag = belief(kMoved).tag, .state = TagState::kQuarantined});
  MapBuilder builder({.refine_period_s = 2}, start);
  GraphSolution solution;
  solution.tags.push_back(estimate(kMoved, 1));
  builder.adopt(std::move(solution), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(kMoved)->state, TagState::kCalibrated);
  EXPECT_NE(builder.snapshot()->known->find(kMoved), nullptr);
}

}  // namespace
}  // namespace fiducap
