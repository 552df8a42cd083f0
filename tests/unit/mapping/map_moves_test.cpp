// Moved tags in a map with a graph.
#include <gmock/gmock.h>

#include <functional>

#include "base/pose.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/moved_tags.hpp"
#include "unit/mapping/belief_fixture.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::Eq;
using testing::FieldsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Optional;

constexpr int kMoved = 7;
constexpr double kSigma = 0.002;
const std::vector<int> kOthers{2, 3};

Instant at(int second) { return instant_from_ns(second * 1'000'000'000LL); }

GraphTagEstimate estimate(int tag_id, double x, int epoch = 0) {
  return graph_estimate(tag_id, x, epoch, kSigma);
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
    contradict(builder_, second, contradicted, fitting);
  }
  static void contradict(MapBuilder& builder, int second, const std::vector<int>& contradicted,
                         const std::vector<int>& fitting) {
    builder.absorb({.body_id = 1,
                    .at = at(second),
                    .anchored = true,
                    .contradicted = contradicted,
                    .fitting = fitting},
                   kNow_utc_ns);
  }
  /// Enough contradictions …
  void notice(int second) {
    for (int i = 0; i < 3; ++i) contradict(second);
  }
  /// … and a solution with another pose.
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

TEST_F(MapMovesTest, QuarantinesAContradictedTag) {
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
  EXPECT_EQ(builder_.snapshot()->known->revision, revision + 1) << "filters use it";
  const auto moves = builder_.take_segments().moves;
  ASSERT_EQ(moves.size(), 1U);
  EXPECT_EQ(moves[0].tag_id, kMoved);
  EXPECT_EQ(moves[0].opens->gone, at(20));
  EXPECT_EQ(moves[0].opens->back, at(23));
  EXPECT_TRUE(builder_.take_segments().moves.empty());
  EXPECT_THAT(builder_.take_events(),
              ElementsAre(event_of(MapEvent::Kind::kTagQuarantined,
                                   "between 22:14:57 and 22:15:00 UTC, seen by body 1")));
}

TEST_F(MapMovesTest, UsesTheTagAtItsNewPoseAndReportsTheMove) {
  notice(23);
  adopt({estimate(kMoved, 1)});
  EXPECT_EQ(state(), TagState::kQuarantined) << "of the old epoch";
  EXPECT_EQ(builder_.snapshot()->find(kMoved)->tag.X_WT.p.x(), 1);
  auto young = estimate(kMoved, 1.3, 1);
  young.sightings = 12;
  adopt({young});
  EXPECT_EQ(state(), TagState::kQuarantined) << "few sightings";
  (void)builder_.take_events();
  auto moved = estimate(kMoved, 1.3, 1);
  moved.X_WT.q = exp_so3({0, 0, 0.0717});
  adopt({moved});
  EXPECT_EQ(state(), TagState::kCalibrated);
  EXPECT_TRUE(is_known());
  EXPECT_EQ(builder_.snapshot()->find(kMoved)->tag.X_WT.p.x(), 1.3);
  EXPECT_THAT(builder_.take_events(),
              ElementsAre(AllOf(
                  event_of(MapEvent::Kind::kTagMoved, "tag 7 was moved by 300 mm and 4.1° between"),
                  event_of(MapEvent::Kind::kTagMoved, "seen by body 1"))));
}

TEST_F(MapMovesTest, UnitesTheSightingsOfAnUnmovedTag) {
  notice(23);
  (void)builder_.take_segments();
  (void)builder_.take_events();
  adopt({estimate(kMoved, 1), estimate(kMoved, 1 + kSigma, 1)});
  EXPECT_EQ(state(), TagState::kCalibrated);
  EXPECT_THAT(builder_.take_events(),
              ElementsAre(event_of(MapEvent::Kind::kTagDisputed, "is in its old place")));
  const auto moves = builder_.take_segments().moves;
  ASSERT_EQ(moves.size(), 1U);
  EXPECT_FALSE(moves[0].opens);
  for (int second = 24; second < 60; ++second) contradict(second);
  EXPECT_EQ(state(), TagState::kCalibrated) << "not tested for a minute";
}

TEST_F(MapMovesTest, ComparesWithTheRefinedOldPose) {
  notice(23);
  adopt({estimate(kMoved, 1.05), estimate(kMoved, 1.05 + kSigma, 1)});
  EXPECT_EQ(builder_.take_events().back().kind, MapEvent::Kind::kTagDisputed);
}

TEST_F(MapMovesTest, QuarantinesATagSeenAtTwoPlacesInTurn) {
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
  EXPECT_EQ(state(), TagState::kQuarantined) << "permanently";
  EXPECT_TRUE(builder_.take_events().empty());
}

TEST_F(MapMovesTest, ReportsATagThatIsMovedBack) {
  notice(22);
  auto open = estimate(kMoved, 1.5, 1);
  open.last_seen = at(31);
  adopt({estimate(kMoved, 1), open});
  (void)builder_.take_segments();
  notice(32);  // not seen there since
  EXPECT_EQ(builder_.take_segments().moves.at(0).opens->gone, at(31));
  adopt({estimate(kMoved, 1), open, estimate(kMoved, 1, 2)});
  EXPECT_THAT(builder_.take_events().back().text, HasSubstr(", back to a place it had left"));
}

TEST_F(MapMovesTest, QuarantinesATagThatKeepsMoving) {
  for (int second = 22; second < 30; ++second) notice(second);
  EXPECT_THAT(builder_.take_events().back().text, HasSubstr("something that moves"));
}

TEST_F(MapMovesTest, ReportsOnceInAFrozenMap) {
  builder_.set_mode(MapMode::kFrozen);
  const auto before = builder_.snapshot();
  for (int second = 22; second < 60; ++second) contradict(second);
  EXPECT_EQ(builder_.snapshot(), before);
  EXPECT_TRUE(builder_.take_segments().moves.empty());
  EXPECT_THAT(builder_.take_events(),
              ElementsAre(event_of(MapEvent::Kind::kTagDisputed, "frozen")));
}

TEST_F(MapMovesTest, KeepsASurveyedTag) {
  TagMap start;
  start.tags.push_back({.tag = belief(kMoved).tag, .state = TagState::kSurveyed});
  MapBuilder builder({.refine_period_s = 2}, start);
  for (int second = 22; second < 60; ++second) contradict(builder, second, {kMoved}, kOthers);
  EXPECT_EQ(builder.snapshot()->find(kMoved)->state, TagState::kSurveyed);
  ASSERT_EQ(builder.take_events().size(), 1U);
}

TEST(MapMoves, UsesStoredCorrelationsWithAGraphOnly) {
  const TagMap stored = with_ties(make_map({2, kMoved}));
  const MapBuilder with_graph({.refine_period_s = 2}, stored);
  EXPECT_NE(with_graph.snapshot()->known, nullptr);
  const MapBuilder with_beliefs({.refine_period_s = 0}, stored);
  EXPECT_EQ(with_beliefs.snapshot()->known, nullptr);
  EXPECT_NE(with_beliefs.snapshot()->find(kMoved), nullptr);
}

TEST(MapMoves, UsesAQuarantinedTagOnceTheGraphHasIt) {
  TagMap start;
  start.tags.push_back({.tag = belief(kMoved).tag, .state = TagState::kQuarantined});
  MapBuilder builder({.refine_period_s = 2}, start);
  GraphSolution solution;
  solution.tags.push_back(estimate(kMoved, 1));
  builder.adopt(std::move(solution), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(kMoved)->state, TagState::kCalibrated);
  EXPECT_NE(builder.snapshot()->known->find(kMoved), nullptr);
}

class TagWatchTest : public testing::Test {
 protected:
  static Instant at(int second) { return instant_from_ns(second * 1'000'000'000LL); }

  std::vector<TagDisplacement> report(int body_id, int second, const std::vector<int>& fitting,
                                      const std::vector<int>& contradicted = {}) {
    return watch_.report(body_id, at(second), fitting, contradicted);
  }

  TagWatch watch_;
};

TEST_F(TagWatchTest, ThreeReportsOfOneBodyDecide) {
  EXPECT_THAT(report(1, 1, {2, 3, 7}), IsEmpty());
  EXPECT_THAT(report(1, 4, {2, 3}, {7}), IsEmpty());
  EXPECT_THAT(report(1, 4, {2, 3}, {7}), IsEmpty()) << "two reports are too few";
  const auto gone = report(1, 5, {2, 3}, {7});
  EXPECT_THAT(gone, ElementsAre(FieldsAre(7, Optional(at(1)), at(4), at(5), ElementsAre(1))));
  EXPECT_THAT(report(1, 6, {2, 3}, {7}), IsEmpty()) << "counts from zero";
}

TEST_F(TagWatchTest, TwoBodiesDecideTogether) {
  for (int i = 0; i < 2; ++i) (void)report(1, 1, {2, 3}, {7});
  EXPECT_THAT(report(2, 200, {4, 5}, {7}),
              ElementsAre(FieldsAre(7, Eq(std::nullopt), at(1), at(200), ElementsAre(1, 2))));
}

TEST_F(TagWatchTest, IgnoresABodyThatContradictsManyTags) {
  (void)report(1, 1, {2, 3});
  EXPECT_THAT(report(1, 2, {2, 3, 4, 5, 6}, {7}), IsEmpty());
  for (int i = 0; i < 9; ++i) EXPECT_THAT(report(1, 3, {2, 3, 4, 5, 6}, {8}), IsEmpty());
  for (int second = 4; second < 60; ++second)
    EXPECT_THAT(report(1, second, {}, {2 + second % 10}), IsEmpty()) << second;
}

TEST_F(TagWatchTest, IgnoresItsEarlierReports) {
  for (int i = 0; i < 2; ++i) (void)report(1, 1, {2, 3}, {7});
  (void)report(1, 2, {}, {2});
  for (int i = 0; i < 2; ++i)
    EXPECT_THAT(report(2, 3, {4, 5}, {7}), IsEmpty()) << "the first valid reports";
  EXPECT_EQ(report(2, 4, {4, 5}, {7}).size(), 1U);
}

TEST_F(TagWatchTest, IgnoresABodyWithFewOrOldFittingTags) {
  for (int second = 1; second < 60; ++second) EXPECT_THAT(report(1, second, {2}, {7}), IsEmpty());
  watch_ = {};
  (void)report(1, 1, {2, 3, 4, 5});
  for (int second = 10; second < 60; ++second) EXPECT_THAT(report(1, second, {}, {7}), IsEmpty());
}

TEST_F(TagWatchTest, UsesABodyAgainWhenTagsFit) {
  (void)report(1, 1, {}, {2, 3, 4});
  for (int i = 0; i < 2; ++i) EXPECT_THAT(report(1, 2, {2, 3, 4}, {7}), IsEmpty());
  EXPECT_EQ(report(1, 3, {2, 3, 4}, {7}).size(), 1U);
}

TEST_F(TagWatchTest, AcceptsTwoMovedTagsOfEight) {
  for (int i = 0; i < 2; ++i) (void)report(1, 2, {1, 2, 3, 4, 5, 6}, {7, 8});
  EXPECT_EQ(report(1, 3, {}, {7, 8}).size(), 2U);
}

TEST_F(TagWatchTest, CountsRecentReportsWithoutASightingInPlace) {
  struct Case {
    const char* what;
    std::function<void()> after_two_reports;
    int second;
    std::size_t gone;
  };
  const Case cases[] = {
      {"the tag fits, with another",
       [this] {
         (void)report(2, 2, {4, 7});
       },
       3, 0},
      {"a single tag always fits", [this] { (void)report(2, 2, {7}); }, 3, 1},
      {"old reports", [] {}, 1000, 0},
      {"a new pose", [this] { watch_.forget(7); }, 2, 0},
  };
  for (const Case& one : cases) {
    watch_ = {};
    for (int i = 0; i < 2; ++i) (void)report(1, 1, {2, 3}, {7});
    one.after_two_reports();
    EXPECT_EQ(report(1, one.second, {2, 3}, {7}).size(), one.gone) << one.what;
  }
}

}  // namespace
}  // namespace fiducap
