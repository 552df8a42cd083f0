#include "streaming/natnet/registry.hpp"

#include <gtest/gtest.h>

namespace fiducap::natnet {
namespace {

TEST(Selection, StartsWithEverything) {
  const Selection selection;
  EXPECT_TRUE(selection.is_everything());
  EXPECT_TRUE(selection.has(1));
}

TEST(Selection, SubscribedDataOnlyLeavesNothingUntilSomethingIsAskedFor) {
  Selection selection;
  selection.only_subscribed();
  EXPECT_FALSE(selection.has(1));
  selection.body(2, true);
  EXPECT_TRUE(selection.has(2));
  EXPECT_FALSE(selection.has(1));
  EXPECT_FALSE(selection.is_everything());
}

TEST(Selection, TheNarrowerRuleWins) {
  Selection selection;
  selection.all_types(true);
  selection.rigid_bodies(false);
  selection.body(7, true);
  EXPECT_TRUE(selection.has(7));
  EXPECT_FALSE(selection.has(8));
  selection.rigid_bodies(true);
  selection.body(7, false);
  EXPECT_FALSE(selection.has(7));
  EXPECT_TRUE(selection.has(8));
}

TEST(Selection, ClearGoesBackToTheDefault) {
  Selection selection;
  selection.only_subscribed();
  selection.body(7, true);
  selection.clear();
  EXPECT_EQ(selection, Selection());
}

TEST(Selection, ABodyStandsOnceHoweverOftenItIsNamed) {
  Selection once;
  once.body(3, true);
  Selection often;
  for (int i = 0; i < 1000; ++i) often.body(3, true);
  EXPECT_EQ(once, often);
}

}  // namespace
}  // namespace fiducap::natnet
