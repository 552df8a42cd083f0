#include "mapping/tag_map.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "base/pose.hpp"
#include "mapping/map_edit.hpp"
#include "support/results.hpp"
#include "unit/mapping/map_fixture.hpp"

namespace fiducap {
namespace {

using testing::DoubleNear;
using testing::FieldsAre;
using testing::HasSubstr;

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
  using Kind = TagChange::Kind;
  using testing::_;
  EXPECT_THAT(changes, testing::ElementsAre(
                           FieldsAre(1, Kind::kRemoved, _, _),
                           FieldsAre(2, Kind::kMoved, DoubleNear(2, 1e-9), DoubleNear(0, 1e-6)),
                           FieldsAre(3, Kind::kMoved, _, DoubleNear(1, 1e-6)),
                           FieldsAre(4, Kind::kAdded, _, _)));
  EXPECT_TRUE(diff(before, before).empty());
}

constexpr double kMostOff_m = 0.05;
constexpr double kRounding_m = 1e-9;

class MapAlignmentTest : public testing::Test {
 protected:
  MapAlignmentTest() {
    map_.version = 4;
    const std::vector<Eigen::Vector3d> places{{0, 0, 1}, {4, 0, 1.5}, {4, 3, 2}, {-1, 5, 0.5}};
    for (int id = 0; id < 4; ++id) {
      MapTag entry;
      entry.tag.tag_id = 10 + id;
      entry.tag.edge_m = 0.16;
      entry.tag.X_WT.p = places[static_cast<std::size_t>(id)];
      entry.tag.covariance = 4e-6 * Matrix6d::Identity();
      entry.state = TagState::kCalibrated;
      map_.tags.push_back(entry);
      measured_.push_back({10 + id, X_RW_ * entry.tag.X_WT.p});
    }
  }
  [[nodiscard]] std::string refused() const { return error_of(align(map_, measured_, kMostOff_m)); }

  Pose X_RW_{exp_so3({0, 0, 0.7}), {10, -20, 0.3}};
  TagMap map_;
  std::vector<MeasuredPlace> measured_;
};

TEST_F(MapAlignmentTest, FindsYawAndShift) {
  const auto aligned = value_of(align(map_, measured_, kMostOff_m));
  EXPECT_LT((aligned.X_RW.p - X_RW_.p).norm(), kRounding_m);
  EXPECT_LT(angle_between(aligned.X_RW.q, X_RW_.q), kRounding_m);
  ASSERT_EQ(aligned.residuals.size(), 4U);
  for (const auto& one : aligned.residuals) EXPECT_LT(one.off_m.norm(), kRounding_m);
}

TEST_F(MapAlignmentTest, DistributesResidualsAmongTheTags) {
  measured_[1].p_RT.x() += 0.02;
  const auto aligned = value_of(align(map_, measured_, kMostOff_m));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& one : aligned.residuals) sum += one.off_m;
  EXPECT_LT(sum.norm(), kRounding_m);
  EXPECT_GT(aligned.residuals[1].off_m.x(), 0.01);
}

TEST_F(MapAlignmentTest, NamesTheTagThatContradictsTheOthers) {
  for (std::size_t i = 0; i < measured_.size(); ++i) {
    const MeasuredPlace good = measured_[i];
    measured_[i].p_RT.y() += 0.4;
    EXPECT_THAT(refused(), HasSubstr("the place of tag " + std::to_string(good.tag_id) +
                                     " contradicts the others: it is 400 mm"));
    measured_[i] = good;
  }
}

TEST_F(MapAlignmentTest, ReportsMillimetresAndAMirroredRoom) {
  const auto right = measured_;
  for (MeasuredPlace& place : measured_) place.p_RT *= 1000;
  EXPECT_THAT(refused(), HasSubstr("1000 times as far apart"));
  measured_ = right;
  for (MeasuredPlace& place : measured_) place.p_RT.x() = -place.p_RT.x();
  EXPECT_THAT(refused(), HasSubstr("mirrored, x and y are left-handed"));
  measured_ = right;
  for (MeasuredPlace& place : measured_) place.p_RT.z() = -place.p_RT.z();
  EXPECT_THAT(refused(), HasSubstr("mirrored, z points down"));
  EXPECT_THAT(refused(), HasSubstr("(tag 1"));
}

TEST_F(MapAlignmentTest, RefusesTooLittleInformation) {
  const auto all = measured_;
  measured_.resize(2);
  EXPECT_THAT(refused(), HasSubstr("three tags or more, has 2"));
  measured_ = {all[0], all[1], all[1]};
  EXPECT_THAT(refused(), HasSubstr("tag 11 is there twice"));
  measured_ = {all[0], all[1], {77, {1, 2, 3}}};
  EXPECT_THAT(refused(), HasSubstr("tag 77 is not in version 4"));
  measured_ = all;
  map_.tags[2].state = TagState::kQuarantined;
  EXPECT_THAT(refused(), HasSubstr("tag 12 is quarantined"));
  map_.tags[2].state = TagState::kCalibrated;
  for (MapTag& entry : map_.tags) entry.tag.X_WT.p.head<2>().setZero();
  EXPECT_THAT(refused(), HasSubstr("above each other"));
}

TEST_F(MapAlignmentTest, GivesDistancesWithCorrelatedSigmas) {
  const auto alone = value_of(distance_between(map_, 10, 11));
  EXPECT_NEAR(alone.distance_m, std::hypot(4, 0.5), kRounding_m);
  EXPECT_NEAR(alone.sigma_m, std::sqrt(8e-6), kRounding_m);
  EXPECT_FALSE(alone.is_correlated);
  auto known = std::make_shared<KnownMap>();
  known->pairs.push_back({10, 11, 3e-6 * Matrix6d::Identity()});
  map_.known = known;
  const auto tied = value_of(distance_between(map_, 11, 10));
  EXPECT_NEAR(tied.sigma_m, std::sqrt(2e-6), kRounding_m);
  EXPECT_TRUE(tied.is_correlated);
  EXPECT_FALSE(distance_between(map_, 10, 10));
  EXPECT_FALSE(distance_between(map_, 10, 99));
}

}  // namespace
}  // namespace fiducap
