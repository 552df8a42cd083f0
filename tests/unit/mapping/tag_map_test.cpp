#include "mapping/tag_map.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

TEST(TagMap, FindsATagByItsId) {
  const auto map = make_map({2, 5, 9});
  ASSERT_NE(map.find(5), nullptr);
  EXPECT_EQ(map.find(5)->tag.tag_id, 5);
  for (const int missing : {1, 6, 10}) EXPECT_EQ(map.find(missing), nullptr) << missing;
  EXPECT_EQ(TagMap{}.find(0), nullptr);
}

TEST(TagMap, GivesUsableTagsToAFilter) {
  auto map = make_map({2, 5, 9, 11});
  map.tags[1].state = TagState::kQuarantined;
  map.tags[2].component = 3;
  TagObservations seen;
  for (const int id : {1, 2, 5, 9, 11}) seen.tags.push_back({.tag_id = id});
  std::vector<KnownTag> known(7);
  map.known_among(seen, known);
  ASSERT_EQ(known.size(), 2u);
  EXPECT_EQ(known[0].tag_id, 2);
  EXPECT_EQ(known[1].tag_id, 11);
  EXPECT_EQ(known[1].X_WT.p, map.find(11)->tag.X_WT.p);
}

TEST(TagState, HasNamesThatAreReadBack) {
  for (const auto state :
       {TagState::kLocal, TagState::kCalibrated, TagState::kSurveyed, TagState::kQuarantined})
    EXPECT_EQ(tag_state_from(name_of(state)), state);
  EXPECT_EQ(tag_state_from("Local"), std::nullopt);
  EXPECT_EQ(tag_state_from(""), std::nullopt);
}

TEST(TagMap, NamesItsFault) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  struct Case {
    const char* fault;
    void (*make)(TagMap&);
  };
  const Case cases[] = {
      {"tag 5: id is there twice", [](TagMap& m) { m.tags[0].tag.tag_id = 5; }},
      {"sorted", [](TagMap& m) { m.tags[0].tag.tag_id = 7; }},
      {"id = -2: must be >= 0", [](TagMap& m) { m.tags[0].tag.tag_id = -2; }},
      {"tag 5: edge_m = 0", [](TagMap& m) { m.tags[1].tag.edge_m = 0; }},
      {"position must be finite", [](TagMap& m) { m.tags[1].tag.X_WT.p.x() = kInfinity; }},
      {"quaternion has length", [](TagMap& m) { m.tags[1].tag.X_WT.q.w() += 0.1; }},
      {"negative variance", [](TagMap& m) { m.tags[1].tag.covariance(3, 3) = -1; }},
      {"alignment to the room", [](TagMap& m) { m.X_RW.q.coeffs().setZero(); }}};
  for (const Case& one : cases) {
    auto map = make_map({2, 5});
    ASSERT_EQ(fault_in(map), std::nullopt);
    one.make(map);
    EXPECT_THAT(fault_in(map), testing::Optional(testing::HasSubstr(one.fault)));
  }
}

TEST(ContentHash, DependsOnTheWholeContentOnly) {
  const auto map = make_map({2, 5});
  const auto hash = content_hash(map);
  EXPECT_EQ(hash.size(), 16u);
  auto same = map;
  same.version = 8;
  same.parent = 7;
  same.hash = "x";
  same.comment = "y";
  same.created_utc_ns = 5;
  EXPECT_EQ(content_hash(same), hash);
  const auto changes = {+[](TagMap& m) { m.family = "tag25h9"; },
                        +[](TagMap& m) { m.reference_tag = 0; },
                        +[](TagMap& m) { m.X_RW.p.z() = 1; },
                        +[](TagMap& m) { m.tags.pop_back(); },
                        +[](TagMap& m) { m.tags[1].tag.X_WT.p.x() += 1e-12; },
                        +[](TagMap& m) { m.tags[1].tag.covariance(2, 4) += 1e-12; },
                        +[](TagMap& m) { m.tags[1].state = TagState::kSurveyed; },
                        +[](TagMap& m) { m.tags[1].last_seen_utc_ns += 1; },
                        +[](TagMap& m) { m.tags[0].sightings += 1; }};
  for (const auto& change : changes) {
    auto other = map;
    change(other);
    EXPECT_NE(content_hash(other), hash);
  }
}

TEST(ContentHash, IsFnv1a) {
  // FNV-1a 64 over length 8 + "tag36h11", a zero byte, eight zero bytes, p = 0 0 0, q = 1 0 0 0.
  EXPECT_EQ(content_hash(TagMap{}), "74e9373e09fb37e9");
}

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
