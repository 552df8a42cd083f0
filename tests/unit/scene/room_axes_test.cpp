#include "scene/scene_frame.hpp"

#include <gtest/gtest.h>

#include <random>

#include "base/pose.hpp"
#include "scene/scene.hpp"

namespace fiducap {
namespace {

std::mt19937_64 random_numbers(20);

Eigen::Vector3d draw(double sigma) {
  std::normal_distribution<double> gauss(0, sigma);
  const double x = gauss(random_numbers);
  const double y = gauss(random_numbers);
  return {x, y, gauss(random_numbers)};
}

Pose drawn_alignment() { return {exp_so3({0, 0, draw(1).z()}), draw(3)}; }

TagMap map_with_tags(const Pose& X_RW) {
  TagMap map;
  map.X_RW = X_RW;
  for (int id : {3, 8}) {
    MapTag tag;
    tag.tag.tag_id = id;
    tag.tag.X_WT = {exp_so3(draw(1)), draw(2)};
    Matrix6d root;
    for (int k = 0; k < 12; ++k) root.block<3, 1>(3 * (k % 2), k / 2) = draw(0.01);
    tag.tag.covariance = root * root.transpose();
    map.tags.push_back(tag);
  }
  return map;
}

TEST(RoomAxes, AreThoseOfTheWorkspaceUntilTheMapIsAligned) {
  RoomAxes room;
  const auto map = std::make_shared<const TagMap>(map_with_tags({}));
  EXPECT_EQ(room.set_map(map), map);
  BodyPose pose;
  pose.X_WP.p = {1, 2, 3};
  room.transform(pose);
  EXPECT_EQ(pose.X_WP.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(room.set_map(nullptr), nullptr);
  EXPECT_EQ(room.number(), 0u);
}

TEST(RoomAxes, AreOtherOnesAfterAnAlignmentNotAfterAnotherMap) {
  RoomAxes room;
  const Pose X_RW = drawn_alignment();
  (void)room.set_map(std::make_shared<const TagMap>(map_with_tags({})));
  (void)room.set_map(std::make_shared<const TagMap>(map_with_tags(X_RW)));
  EXPECT_EQ(room.number(), 1u);
  (void)room.set_map(std::make_shared<const TagMap>(map_with_tags(X_RW)));
  EXPECT_EQ(room.number(), 1u);
  (void)room.set_map(std::make_shared<const TagMap>(map_with_tags({})));
  EXPECT_EQ(room.number(), 2u) << "rolled back";
}

TEST(RoomAxes, PreserveThePoseOfABodyRelativeToATag) {
  RoomAxes room;
  for (int k = 0; k < 50; ++k) {
    const auto map = std::make_shared<const TagMap>(map_with_tags(drawn_alignment()));
    const auto moved = room.set_map(map);
    EXPECT_EQ(room.set_map(map), moved) << "a map is copied once";
    BodyPose pose;
    pose.X_WP = {exp_so3(draw(1)), draw(2)};
    const Pose X_PT = pose.X_WP.inverse() * map->tags[1].tag.X_WT;
    room.transform(pose);
    const Pose now = pose.X_WP.inverse() * moved->tags[1].tag.X_WT;
    EXPECT_LT((now.p - X_PT.p).norm(), 1e-12);
    EXPECT_LT(angle_between(now.q, X_PT.q), 1e-12);
    EXPECT_LT(((map->X_RW * map->tags[0].tag.X_WT).p - moved->tags[0].tag.X_WT.p).norm(), 1e-12);
    EXPECT_TRUE(moved->X_RW.p.isZero(0));
  }
}

TEST(RoomAxes, NeverTiltWhatIsStreamed) {
  RoomAxes room;
  const Pose tilted{exp_so3({0, 0, 0.7}) * exp_so3({0.4, 0, 0}), {1, 2, 3}};
  const auto moved = room.set_map(std::make_shared<const TagMap>(map_with_tags(tilted)));
  BodyPose pose;
  room.transform(pose);
  EXPECT_LT((pose.X_WP.q * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  EXPECT_LT(angle_between(pose.X_WP.q, exp_so3({0, 0, 0.7})), 1e-12);
  EXPECT_EQ(pose.X_WP.p, Eigen::Vector3d(1, 2, 3));
}

/// Errors drawn in W and transformed have the covariance in R.
TEST(RoomAxes, TurnVelocitiesAndUncertaintiesAlong) {
  constexpr double kTiny = 1e-6;
  RoomAxes room;
  const auto map = std::make_shared<const TagMap>(map_with_tags(drawn_alignment()));
  (void)room.set_map(map);
  BodyPose pose;
  pose.X_WP = {exp_so3(draw(1)), draw(2)};
  pose.v_WP = draw(1);
  pose.w_WP_P = draw(1);
  Matrix12d root;
  for (int k = 0; k < 48; ++k) root.block<3, 1>(3 * (k % 4), k / 4) = draw(kTiny);
  pose.covariance = root * root.transpose();
  BodyPose in_room = pose;
  room.transform(in_room);
  EXPECT_LT((in_room.v_WP - map->X_RW.q * pose.v_WP).norm(), 1e-12);
  EXPECT_EQ(in_room.w_WP_P, pose.w_WP_P) << "is in the body's own axes";
  // Each column of the root is an error; moved with the body it must be a column of the new root.
  Matrix12d moved;
  for (int k = 0; k < 12; ++k) {
    BodyPose off = pose;
    off.X_WP.p += root.block<3, 1>(0, k);
    off.X_WP.q = exp_so3(root.block<3, 1>(3, k)) * off.X_WP.q;
    off.v_WP += root.block<3, 1>(6, k);
    room.transform(off);
    moved.block<3, 1>(0, k) = off.X_WP.p - in_room.X_WP.p;
    moved.block<3, 1>(3, k) = log_so3(off.X_WP.q * in_room.X_WP.q.conjugate());
    moved.block<3, 1>(6, k) = off.v_WP - in_room.v_WP;
    moved.block<3, 1>(9, k) = root.block<3, 1>(9, k);
  }
  EXPECT_LT((moved * moved.transpose() - in_room.covariance).norm(), 1e-4 * kTiny * kTiny);
}

TEST(Scene, IsInTheRoomsAxesOnceTheMapIsAligned) {
  SceneBody body;
  body.description = {1, "alpha"};
  body.sensors.imu = ImuNoise{};
  Scene scene({body});
  BodyEstimate estimate;
  estimate.at = instant_from_ns(1'000'000'000);
  estimate.covariance = Matrix15d::Identity() * 1e-6;
  estimate.anchored = true;
  estimate.X_WB.p = {1, 0, 0};
  UpdateReport report;
  report.exposed_at = estimate.at;
  report.tags_used = 2;
  scene.ingest(0, estimate, report, {}, 0);
  const Pose X_RW{exp_so3({0, 0, M_PI / 2}), {0, 0, 5}};
  const auto map = std::make_shared<const TagMap>(map_with_tags(X_RW));
  const auto frame = scene.sample(estimate.at, estimate.at, {}, 100, map);
  EXPECT_LT((frame->bodies[0].X_WP.p - Eigen::Vector3d(0, 1, 5)).norm(), 1e-12);
  EXPECT_EQ(frame->axes, 1u);
  EXPECT_LT((frame->map->tags[0].tag.X_WT.p - X_RW * map->tags[0].tag.X_WT.p).norm(), 1e-12);
}

}  // namespace
}  // namespace fiducap
