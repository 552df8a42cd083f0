// Which body defines the workspace, and when.
#include <gtest/gtest.h>

#include "mapping/map_builder.hpp"
#include "unit/mapping/belief_fixture.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

TEST(Workspace, BelongsToTheFirstBodyThatAnchorsAndAllOthersWait) {
  MapBuilder builder(kByBeliefs, TagMap{});
  EXPECT_TRUE(builder.view(1).may_define_workspace);
  EXPECT_FALSE(builder.view(2).may_define_workspace) << "1 is at work";
  builder.absorb({.body_id = 1}, kNow_utc_ns);
  EXPECT_TRUE(builder.view(2).may_define_workspace) << "1 saw no tag";
  builder.absorb({.body_id = 2, .anchored = true}, kNow_utc_ns);
  EXPECT_FALSE(builder.view(1).may_define_workspace);
  EXPECT_TRUE(builder.view(2).may_define_workspace) << "after a reset, while the map is empty";
  builder.absorb({.body_id = 2, .anchored = true}, kNow_utc_ns);
  const auto first = belief(7);
  builder.absorb(from(2, first), kNow_utc_ns);
  EXPECT_FALSE(builder.view(2).may_define_workspace) << "now the map says where it is";
}

TEST(Workspace, IsFreeAgainWhenTheBodyThatDefinedItIsGoneBeforeAnythingWasMapped) {
  MapBuilder builder(kByBeliefs, TagMap{});
  (void)builder.view(1);
  builder.absorb({.body_id = 1, .anchored = true}, kNow_utc_ns);
  EXPECT_FALSE(builder.view(2).may_define_workspace);
  builder.release(1);
  EXPECT_TRUE(builder.view(2).may_define_workspace);
}

TEST(Workspace, IsWhereTheStartingMapHasItAlsoWithoutTheReferenceTag) {
  TagMap start = make_map({1, 2});
  start.reference_tag = 7;
  MapBuilder builder(kByBeliefs, start);
  EXPECT_FALSE(builder.view(1).may_define_workspace) << "tags 1 and 2 say where it is";
}

TEST(Workspace, IsThereAgainWhenATagThatStartedQuarantinedIsLearned) {
  TagMap start = make_map({1});
  start.tags[0].state = TagState::kQuarantined;
  MapBuilder builder(kByBeliefs, start);
  EXPECT_TRUE(builder.view(1).may_define_workspace);
  const auto anew = belief(1, 0.01, 5.0);
  builder.absorb(from(1, anew), kNow_utc_ns);
  EXPECT_FALSE(builder.view(1).may_define_workspace) << "also not after a reset";
}

TEST(Workspace, IsTheReferenceTagForEveryBodyUntilTheMapHasIt) {
  TagMap start;
  start.reference_tag = 7;
  MapBuilder builder(kByBeliefs, start);
  EXPECT_TRUE(builder.view(1).may_define_workspace);
  EXPECT_TRUE(builder.view(2).may_define_workspace);
  const auto first = belief(7);
  builder.absorb(from(2, first), kNow_utc_ns);
  EXPECT_FALSE(builder.view(1).may_define_workspace);
}

TEST(Workspace, IsTheGraphsOnceItHasSpokenAlsoForWhoSeesTheReferenceTag) {
  TagMap start;
  start.reference_tag = 7;
  MapBuilder builder(kByBeliefs, start);
  EXPECT_TRUE(builder.view(1).may_define_workspace);
  GraphTagEstimate tag;
  tag.tag_id = 3;
  tag.edge_m = 0.2;
  tag.sightings = 50;
  tag.covariance = 1e-6 * Matrix6d::Identity();
  GraphSolution solution;
  solution.tags.push_back(tag);
  (void)builder.adopt(solution, 0);
  EXPECT_FALSE(builder.view(1).may_define_workspace);
  ASSERT_NE(builder.snapshot()->known, nullptr);
  EXPECT_NE(builder.snapshot()->known->find(3), nullptr);
}

}  // namespace
}  // namespace fiducap
