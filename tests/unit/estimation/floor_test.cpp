// The vertical without an IMU, by tags on the floor.
#include "estimation/filter/heading_rule.hpp"

#include <gtest/gtest.h>

#include <array>

#include "base/pose.hpp"
#include "example_room.hpp"

namespace fiducap {
namespace {

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / ExampleRoom::kQuarterTurn / 2;
}

const Eigen::Vector3d kUp = Eigen::Vector3d(0.3, -0.9, 0.4).normalized();

/// A tag that lies on the floor, its face tilted by the angle.
Pose lying(const Eigen::Vector3d& place,
           const Eigen::Vector3d& tilt_rad = Eigen::Vector3d::Zero()) {
  const auto q = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), kUp);
  return {q * exp_so3(tilt_rad), q * place};
}

TEST(Floor, DefinesTheVertical) {
  struct Case {
    const char* what;
    std::vector<Pose> tags;
  };
  const Case cases[] = {
      {"the normal of one tag", {lying({1, 2, 0}, {0, 0, 1.1})}},
      {"the positions of three tags",
       {lying({0, 0, 0}, {0.1, 0, 0.4}), lying({2, 0, 0}, {0.1, 0.05, -2}),
        lying({0.5, 1.5, 0}, {0.08, 0, 1})}},
      {"normals, with a tag on a table",
       {lying({0, 0, 0}), lying({2, 0, 0}), lying({0.5, 1.5, 0.8})}},
      {"normals of tags in a row", {lying({0, 0, 0}), lying({2, 0, 0}), lying({4, 0.1, 0.1})}}};
  for (const auto& [what, tags] : cases)
    EXPECT_LT(degrees_between(*up_by_floor(tags), kUp), 1e-6) << what;
}

TEST(Floor, NoTagAndOppositeNormalsDefineNothing) {
  EXPECT_FALSE(up_by_floor({}));
  EXPECT_FALSE(up_by_floor(std::array{lying({0, 0, 0}), lying({2, 0, 0}, {3.1, 0, 0})}));
}

TEST(Floor, ATagIsUprightWithItsOwnHeading) {
  const Eigen::Quaterniond q_AT = exp_so3({0.4, 1.0, -0.6});
  const Eigen::Quaterniond q_WT = upright_attitude(q_AT, kUp);
  EXPECT_LT(degrees_between(q_WT * q_AT.conjugate() * kUp, Eigen::Vector3d::UnitZ()), 1e-6);
  EXPECT_NEAR((q_WT * Eigen::Vector3d::UnitX()).y(), 0, 1e-9);
}

/// A wall of tags with three more on a board before it, without an IMU.
class FloorInARoom : public BothFilters {
 protected:
  ExampleRoom room(std::vector<int> floor_tags) {
    ExampleRoom room({.filter = GetParam(),
                      .gauge = {.reference_tag = {}, .X_WT = {}, .floor_tags = floor_tags},
                      .has_imu = false});
    for (int i = 0; i < 3; ++i)
      room.tags[10 + i] = {exp_so3({0, 0, 0.3 * i}), {-0.5 + 0.5 * i, 1.6 + 0.35 * (i % 2), 0.5}};
    return room;
  }
  static double tilt_deg(const ExampleRoom& room) {
    return degrees_between(room.X_WR().q * Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ());
  }
};

TEST_P(FloorInARoom, ConfiguredFloorTagsMakeTheWorkspaceUpright) {
  ExampleRoom upright = room({10, 11, 12});
  upright.images(200);
  ASSERT_TRUE(upright.is_anchored());
  // Three tags half a metre apart, each known to a centimetre when W is defined.
  EXPECT_LT(tilt_deg(upright), 3);

  ExampleRoom unconfigured = room({});
  unconfigured.images(200, {}, {0, 1, 2, 3, 4, 5});
  ASSERT_TRUE(unconfigured.is_anchored());
  EXPECT_GT(tilt_deg(unconfigured), 45) << "a tag on the wall is no floor";
}

TEST_P(FloorInARoom, NoPoseIsInTheWorkspaceBeforeTheFloorIsSeen) {
  ExampleRoom waiting = room({10, 11});
  waiting.images(100, {}, {0, 1, 2, 3, 4, 5, 10});
  ASSERT_TRUE(waiting.filter->running());
  EXPECT_FALSE(waiting.is_anchored());
  waiting.images(60);
  EXPECT_TRUE(waiting.is_anchored());
}

INSTANTIATE_TEST_SUITE_P(Filters, FloorInARoom, kBothFilters, name_of_filter);

}  // namespace
}  // namespace fiducap
