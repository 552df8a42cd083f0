#include "mapping/map_edit.hpp"

#include <gmock/gmock.h>

#include "base/pose.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

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

TEST_F(MapAlignmentTest, ReportsAMirroredRoom) {
  for (MeasuredPlace& place : measured_) place.p_RT.x() = -place.p_RT.x();
  EXPECT_THAT(refused(), HasSubstr("mirrored, x and y are left-handed"));
  for (MeasuredPlace& place : measured_) place.p_RT.x() = -place.p_RT.x();
  for (MeasuredPlace& place : measured_) place.p_RT.z() = -place.p_RT.z();
  EXPECT_THAT(refused(), HasSubstr("mirrored, z points down"));
  EXPECT_THAT(refused(), HasSubstr("(tag 1"));
}

TEST_F(MapAlignmentTest, ReportsMillimetres) {
  for (MeasuredPlace& place : measured_) place.p_RT *= 1000;
  EXPECT_THAT(refused(), HasSubstr("1000 times as far apart"));
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
