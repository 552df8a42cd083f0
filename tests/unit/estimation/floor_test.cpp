// Without an IMU: what is up, by tags that lie on the floor.
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

TEST(Floor, OneTagDefinesTheVerticalByItsNormal) {
  const std::array tags{lying({1, 2, 0}, {0, 0, 1.1})};
  EXPECT_LT(degrees_between(*up_by_floor(tags), kUp), 1e-6);
  EXPECT_FALSE(up_by_floor({}));
}

TEST(Floor, ThreeTagsApartDefineItByTheirPositions) {
  const std::array tags{lying({0, 0, 0}, {0.1, 0, 0.4}), lying({2, 0, 0}, {0.1, 0.05, -2}),
                        lying({0.5, 1.5, 0}, {0.08, 0, 1})};
  EXPECT_LT(degrees_between(*up_by_floor(tags), kUp), 1e-6);
}

TEST(Floor, NormalsDefineItWithATagOnATableOrAllInARow) {
  const std::array table{lying({0, 0, 0}), lying({2, 0, 0}), lying({0.5, 1.5, 0.8})};
  EXPECT_LT(degrees_between(*up_by_floor(table), kUp), 1e-6);
  const std::array row{lying({0, 0, 0}), lying({2, 0, 0}), lying({4, 0.1, 0.1})};
  EXPECT_LT(degrees_between(*up_by_floor(row), kUp), 1e-6);
}

TEST(Floor, OppositeNormalsDefineNothing) {
  const std::array tags{lying({0, 0, 0}), lying({2, 0, 0}, {3.1, 0, 0})};
  EXPECT_FALSE(up_by_floor(tags));
}

TEST(Floor, ATagIsUprightWithItsOwnHeading) {
  const Eigen::Quaterniond q_AT = exp_so3({0.4, 1.0, -0.6});
  const Eigen::Quaterniond q_WT = upright_attitude(q_AT, kUp);
  EXPECT_LT(degrees_between(q_WT * q_AT.conjugate() * kUp, Eigen::Vector3d::UnitZ()), 1e-6);
  EXPECT_NEAR((q_WT * Eigen::Vector3d::UnitX()).y(), 0, 1e-9);
}

/// A wall of tags with three more on a board before it, without an IMU.
class FloorInARoom : public testing::TestWithParam<const char*> {
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
    const Eigen::Quaterniond q_WR = room.filter->estimate().X_WB.q * room.truth().q.conjugate();
    return degrees_between(q_WR * Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ());
  }
  // Three tags half a metre apart, each known to a centimetre when W is defined.
  static constexpr double kUpright_deg = 3;
};

TEST_P(FloorInARoom, TheWorkspaceIsUprightWithConfiguredFloorTags) {
  ExampleRoom anchored_room = room({10, 11, 12});
  for (int i = 0; i < 200; ++i) anchored_room.next_image({});
  ASSERT_TRUE(anchored_room.filter->estimate().anchored);
  EXPECT_LT(tilt_deg(anchored_room), kUpright_deg);

  ExampleRoom untold = room({});
  for (int i = 0; i < 200; ++i) untold.next_image({}, {0, 1, 2, 3, 4, 5});
  ASSERT_TRUE(untold.filter->estimate().anchored);
  EXPECT_GT(tilt_deg(untold), 45) << "a tag on the wall is no floor";
}

TEST_P(FloorInARoom, NoPoseIsInTheWorkspaceBeforeTheFloorWasSeen) {
  ExampleRoom anchored_room = room({10, 11});
  for (int i = 0; i < 100; ++i) anchored_room.next_image({}, {0, 1, 2, 3, 4, 5, 10});
  ASSERT_TRUE(anchored_room.filter->running());
  EXPECT_FALSE(anchored_room.filter->estimate().anchored);
  for (int i = 0; i < 60; ++i) anchored_room.next_image({});
  EXPECT_TRUE(anchored_room.filter->estimate().anchored);
}

INSTANTIATE_TEST_SUITE_P(BothFilters, FloorInARoom, testing::Values("robocentric", "world"),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace fiducap
