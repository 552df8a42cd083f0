#include "mapping/map_diff.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

TEST(MapDiff, NamesAddedRemovedAndMovedTags) {
  const auto before = make_map({1, 2, 3, 5});
  auto after = make_map({2, 3, 4, 5});
  after.tags[0].tag.X_WT.p.y() += 0.002;
  after.tags[1].tag.X_WT.q = after.tags[1].tag.X_WT.q * exp_so3({0, 0, M_PI / 180});
  after.tags[3].tag.X_WT.p.y() += 0.9e-6;  // below what counts
  const auto changes = diff(before, after);
  ASSERT_EQ(changes.size(), 4u);
  EXPECT_EQ(changes[0].tag_id, 1);
  EXPECT_EQ(changes[0].kind, TagChange::Kind::kRemoved);
  EXPECT_EQ(changes[1].tag_id, 2);
  EXPECT_EQ(changes[1].kind, TagChange::Kind::kMoved);
  EXPECT_NEAR(changes[1].distance_mm, 2.0, 1e-9);
  EXPECT_NEAR(changes[1].angle_deg, 0.0, 1e-6);
  EXPECT_EQ(changes[2].tag_id, 3);
  EXPECT_NEAR(changes[2].angle_deg, 1.0, 1e-6);
  EXPECT_EQ(changes[3].tag_id, 4);
  EXPECT_EQ(changes[3].kind, TagChange::Kind::kAdded);
  EXPECT_TRUE(diff(before, before).empty());
}

}  // namespace
}  // namespace fiducap
