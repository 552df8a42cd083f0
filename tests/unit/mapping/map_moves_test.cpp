// Moved tags.
#include <gmock/gmock.h>

#include <map>

#include "base/pose.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/moved_tags.hpp"
#include "unit/mapping/solution_fixture.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::FieldsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Optional;

constexpr int kMoved = 7;
constexpr double kSigma = 0.002;
// Sightings of an estimate that is confirmed, in a second.
constexpr int kConfirmed = 20;
const std::vector<int> kOthers{2, 3};

Instant at(int second) { return instant_from_ns(second * 1'000'000'000LL); }

/// A body's own estimate of a tag, known for a second.
TagBelief belief(int tag_id, const Pose& X_WT, Instant now, int sightings = kConfirmed) {
  TagBelief own;
  own.tag = {tag_id, 0.2, X_WT, kSigma * kSigma * Matrix6d::Identity()};
  own.sightings = sightings;
  own.first_seen = now - std::chrono::seconds(1);
  own.last_seen = now;
  return own;
}

GraphTagEstimate estimate(int tag_id, double x, int epoch = 0) {
  return graph_estimate(tag_id, x, epoch, kSigma);
}

class MapMovesTest : public testing::Test {
 protected:
  MapMovesTest() : builder_({}, TagMap{}) {
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

  /// The body has the tag five metres away.
  static void contradict(MapBuilder& builder, int second, int sightings = kConfirmed) {
    const std::vector<int> contradicted{kMoved};
    const std::vector<TagBelief> beliefs{
        belief(kMoved, {Eigen::Quaterniond::Identity(), {5, 0, 0}}, at(second), sightings)};
    builder.absorb({.body_id = 1,
                    .at = at(second),
                    .anchored = true,
                    .beliefs = beliefs,
                    .contradicted = contradicted,
                    .fitting = kOthers},
                   kNow_utc_ns);
  }
  void contradict(int second) { contradict(builder_, second); }
  void move(int second, double x, int epoch) {
    contradict(second);
    adopt({estimate(kMoved, x, epoch)});
  }

  [[nodiscard]] TagState state() const { return builder_.snapshot()->find(kMoved)->state; }
  [[nodiscard]] bool is_known() const {
    return builder_.snapshot()->known->find(kMoved) != nullptr;
  }

  MapBuilder builder_;
};

TEST_F(MapMovesTest, QuarantinesAContradictedTag) {
  const std::vector<int> fitting{2, kMoved};
  builder_.absorb({.body_id = 1, .at = at(20), .anchored = true, .fitting = fitting}, kNow_utc_ns);
  const auto revision = builder_.published().revision;
  contradict(builder_, 22, kConfirmed - 1);
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
  contradict(23);
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
                  event_of(MapEvent::Kind::kTagMoved, "tag 7 was moved by 300 mm and 4.1° before"),
                  event_of(MapEvent::Kind::kTagMoved, "seen by body 1"))));
}

TEST_F(MapMovesTest, UnitesTheSightingsOfAnUnmovedTag) {
  contradict(23);
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
  contradict(23);
  adopt({estimate(kMoved, 1.05), estimate(kMoved, 1.05 + kSigma, 1)});
  EXPECT_EQ(builder_.take_events().back().kind, MapEvent::Kind::kTagDisputed);
}

TEST_F(MapMovesTest, QuarantinesATagSeenAtTwoPlacesInTurn) {
  move(22, 1.5, 1);
  move(32, 1.0, 2);
  EXPECT_EQ(state(), TagState::kCalibrated);
  (void)builder_.take_segments();
  contradict(53);
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
  contradict(22);
  auto open = estimate(kMoved, 1.5, 1);
  open.last_seen = at(31);
  adopt({estimate(kMoved, 1), open});
  (void)builder_.take_segments();
  contradict(32);  // not seen there since
  EXPECT_EQ(builder_.take_segments().moves.at(0).opens->gone, at(31));
  adopt({estimate(kMoved, 1), open, estimate(kMoved, 1, 2)});
  EXPECT_THAT(builder_.take_events().back().text, HasSubstr(", back to a place it had left"));
}

TEST_F(MapMovesTest, QuarantinesATagThatKeepsMoving) {
  for (int second = 22; second < 30; ++second) contradict(second);
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
  start.tags.push_back({.tag = make_map({kMoved}).tags[0].tag, .state = TagState::kSurveyed});
  MapBuilder builder({}, start);
  for (int second = 22; second < 60; ++second) contradict(builder, second);
  EXPECT_EQ(builder.snapshot()->find(kMoved)->state, TagState::kSurveyed);
  ASSERT_EQ(builder.take_events().size(), 1U);
}

TEST(MapMoves, UsesStoredCorrelations) {
  const MapBuilder builder({}, with_ties(make_map({2, kMoved})));
  EXPECT_TRUE(builder.snapshot()->known->is_joint(kMoved));
  EXPECT_TRUE(builder.snapshot()->known->uncorrelated.empty());
}

TEST(MapMoves, UsesAQuarantinedTagOnceTheGraphHasIt) {
  TagMap start;
  start.tags.push_back({.tag = make_map({kMoved}).tags[0].tag, .state = TagState::kQuarantined});
  MapBuilder builder({}, start);
  GraphSolution solution;
  solution.tags.push_back(estimate(kMoved, 1));
  builder.adopt(std::move(solution), kNow_utc_ns);
  EXPECT_EQ(builder.snapshot()->find(kMoved)->state, TagState::kCalibrated);
  EXPECT_NE(builder.snapshot()->known->find(kMoved), nullptr);
}

class TagWatchTest : public testing::Test {
 protected:
  /// @return whether these tags are displaced now
  std::vector<int> report(int body_id, int second, const std::vector<int>& fitting,
                          const std::vector<int>& contradicted = {}) {
    std::vector<Contradiction> how;
    for (const int tag_id : contradicted) {
      how.push_back({belief(tag_id, place_of(tag_id), at(second)).tag, std::nullopt});
      if (const auto own = own_.find(tag_id); own != own_.end())
        how.back().own = belief(tag_id, own->second, at(second), sightings_);
    }
    std::vector<int> gone;
    for (const TagDisplacement& one : watch_.report(body_id, at(second), fitting, how))
      gone.push_back(one.tag_id);
    return gone;
  }
  static Pose place_of(int tag_id) {
    return {Eigen::Quaterniond::Identity(), {0.5 * tag_id, 0, 1}};
  }
  static Pose moved(int tag_id) {
    return Pose{Eigen::Quaterniond::Identity(), {0, 0, 0.3 * tag_id}} * place_of(tag_id);
  }

  std::map<int, Pose> own_{{7, moved(7)}, {8, moved(8)}};  ///< As the body estimates them.
  int sightings_{kConfirmed};

  TagWatch watch_;
};

TEST_F(TagWatchTest, TwoOtherTagsInPlaceDecide) {
  (void)watch_.report(1, at(1), std::vector<int>{2, 7}, {});
  const std::vector<Contradiction> how{
      {belief(7, place_of(7), at(4)).tag, belief(7, moved(7), at(4))}};
  EXPECT_THAT(watch_.report(1, at(4), std::vector<int>{2, 3}, how),
              ElementsAre(FieldsAre(7, Optional(at(1)), at(4), 1)));
}

TEST_F(TagWatchTest, OneOtherTagDecidesForABodyThatHadFoundTwo) {
  EXPECT_THAT(report(1, 1, {2}, {7}), IsEmpty());
  EXPECT_THAT(report(1, 5, {2}, {7}), IsEmpty()) << "that one may have been moved";
  watch_ = {};
  (void)report(1, 1, {2, 7});
  EXPECT_THAT(report(1, 2, {2}, {7}), ElementsAre(7));
  watch_ = {};
  (void)report(1, 1, {2, 7});
  EXPECT_THAT(report(1, 12, {2}, {7}), IsEmpty()) << "long ago";
}

TEST_F(TagWatchTest, NeedsAConfirmedEstimateElsewhere) {
  sightings_ = kConfirmed - 1;
  EXPECT_THAT(report(1, 1, {2, 3}, {7}), IsEmpty());
  sightings_ = kConfirmed;
  own_[7] = place_of(7);
  EXPECT_THAT(report(1, 1, {2, 3}, {7}), IsEmpty()) << "in place";
  own_.clear();
  EXPECT_THAT(report(1, 1, {2, 3}, {7}), IsEmpty()) << "not known yet";
  own_[7] = moved(7);
  EXPECT_THAT(report(1, 1, {2, 3}, {7}), ElementsAre(7));
}

TEST_F(TagWatchTest, TwoSwappedTagsOfThreeAreDisplaced) {
  own_ = {{7, place_of(8)}, {8, place_of(7)}};
  (void)report(1, 1, {3, 7, 8});
  EXPECT_THAT(report(1, 2, {3}, {7, 8}), ElementsAre(7, 8));
}

TEST_F(TagWatchTest, ABodyThatDisplacesAllTagsEquallyIsLost) {
  const Pose lost{exp_so3({0, 0, 0.7}), {2, 1, 0}};
  own_ = {{7, lost * place_of(7)}, {8, lost * place_of(8)}};
  (void)report(1, 1, {3, 7, 8});
  EXPECT_THAT(report(1, 2, {3}, {7, 8}), IsEmpty());
  own_.erase(8);
  EXPECT_THAT(report(1, 3, {3}, {7, 8}), IsEmpty()) << "the other one may be equally displaced";
  EXPECT_THAT(report(1, 4, {}, {7}), IsEmpty());
  own_[8] = lost * place_of(8);
  EXPECT_THAT(report(1, 5, {3, 4, 5}, {7, 8}), ElementsAre(7, 8)) << "more tags are in place";
}

TEST_F(TagWatchTest, ABodyThatContradictsOneTagAfterTheOtherIsLost) {
  (void)report(1, 1, {2, 3, 4, 5, 6, 7});
  const Pose lost{Eigen::Quaterniond::Identity(), {0, 0, 1}};
  for (int second = 2; second < 60; ++second) {
    const int tag_id = 2 + second % 10;
    own_[tag_id] = lost * place_of(tag_id);
    EXPECT_THAT(report(1, second, {}, {tag_id}), IsEmpty()) << second;
  }
}

TEST_F(TagWatchTest, ATagFoundInPlaceByAnotherBodyIsThere) {
  (void)report(1, 1, {}, {7});
  (void)report(2, 2, {4, 7});
  EXPECT_THAT(report(1, 3, {2, 3}, {7}), IsEmpty());
  watch_ = {};
  (void)report(1, 1, {}, {7});
  (void)report(2, 2, {7});
  EXPECT_THAT(report(1, 3, {2, 3}, {7}), ElementsAre(7)) << "a single tag always fits";
}

TEST_F(TagWatchTest, ANewPlaceVoidsTheReports) {
  (void)report(1, 1, {2, 3, 7});
  (void)report(1, 2, {2}, {});
  watch_.forget(7);
  own_[7] = place_of(7);
  EXPECT_THAT(report(1, 3, {2, 3}, {7}), IsEmpty());
}

}  // namespace
}  // namespace fiducap
