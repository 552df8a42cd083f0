#include "streaming/vicon/frame_board.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "base/pose.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "support/allocation_counter.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vicon {
namespace {

constexpr double kRounding = 1e-12;  // of products of numbers around 1
constexpr double kSubjectRounding_mm = 1e-9;

SubjectPoses poses_with(WhenInvalid when_invalid = WhenInvalid::kFlag) {
  return SubjectPoses(conventions_of("vicon").axes, when_invalid);
}

TEST(ViconSubjectPoses, MatrixAndRotationVectorTurnSegmentPointsIntoTheWorldInMillimetres) {
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  auto frame = make_scene_frame({"a"});
  auto poses = poses_with();
  for (int i = 0; i < 200; ++i) {
    // Also attitudes half a turn away, tiny ones, and quaternions with a negative real part.
    Pose& X_WP = frame->bodies[0].X_WP;
    X_WP = {exp_so3((i % 4 == 0 ? 1e-9 : 2.0) * vector()), 5 * vector()};
    if (i % 2 == 0) X_WP.q.coeffs() *= -1;
    poses.update(*frame);
    const SegmentPose& segment = poses.all()[0].segment;
    const Eigen::Vector3d p_P = vector();
    const Eigen::Vector3d p_W_mm = 1000 * (X_WP * p_P);
    EXPECT_LT((segment.R * (1000 * p_P) + segment.t_mm - p_W_mm).norm(), kSubjectRounding_mm);
    EXPECT_LT((exp_so3(segment.rotation_vector).toRotationMatrix() - segment.R).norm(),
              1e3 * kRounding);
    EXPECT_LE(segment.rotation_vector.norm(), M_PI + kRounding);
    EXPECT_NEAR(segment.R.determinant(), 1.0, kRounding);
    EXPECT_LT((segment.R * segment.R.transpose() - Eigen::Matrix3d::Identity()).norm(), kRounding);
  }
}

TEST(ViconSubjectPoses, AnInvalidBodyIsListedButNotVisible) {
  auto frame = make_scene_frame({"a", "b"});
  frame->bodies[0].valid = false;
  auto poses = poses_with();
  poses.update(*frame);
  EXPECT_TRUE(poses.all()[0].listed);
  EXPECT_FALSE(poses.all()[0].visible);
  EXPECT_EQ(poses.all()[0].quality, 0.0);
  EXPECT_TRUE(poses.all()[1].visible);
}

TEST(ViconSubjectPoses, StopTakesAnInvalidBodyOffTheList) {
  auto frame = make_scene_frame({"a"});
  frame->bodies[0].valid = false;
  auto poses = poses_with(WhenInvalid::kStop);
  poses.update(*frame);
  EXPECT_FALSE(poses.all()[0].listed);
  EXPECT_FALSE(poses.all()[0].visible);
}

TEST(ViconSubjectPoses, HoldRepeatsTheLastValidPoseWithoutQuality) {
  auto frame = make_scene_frame({"a"});
  auto poses = poses_with(WhenInvalid::kHold);
  frame->bodies[0].valid = false;
  poses.update(*frame);
  EXPECT_FALSE(poses.all()[0].visible) << "nothing to hold yet";
  frame->bodies[0].valid = true;
  poses.update(*frame);
  const Eigen::Vector3d seen = poses.all()[0].segment.t_mm;
  frame->bodies[0].valid = false;
  frame->bodies[0].X_WP.p += Eigen::Vector3d::Ones();
  poses.update(*frame);
  EXPECT_TRUE(poses.all()[0].visible);
  EXPECT_EQ(poses.all()[0].segment.t_mm, seen);
  EXPECT_EQ(poses.all()[0].quality, 0.0);
  frame->axes = 1;
  poses.update(*frame);
  EXPECT_FALSE(poses.all()[0].visible) << "held in axes that are no longer those of the room";
}

TEST(ViconSubjectPoses, NumbersThatAreNoneMakeABodyInvalid) {
  auto frame = make_scene_frame({"a", "b"});
  frame->bodies[0].X_WP.p.x() = std::numeric_limits<double>::quiet_NaN();
  frame->bodies[1].X_WP.q.w() = std::numeric_limits<double>::infinity();
  auto poses = poses_with();
  poses.update(*frame);
  EXPECT_FALSE(poses.all()[0].visible);
  EXPECT_FALSE(poses.all()[1].visible);
}

TEST(ViconSubjectPoses, QualityFallsFromOneAsThePoseGetsUncertain) {
  BodyPose body;
  body.valid = true;
  EXPECT_EQ(quality_of(body), 1.0);
  body.covariance.block<3, 3>(0, 0) = Eigen::Matrix3d::Identity() * 0.02 * 0.02;
  EXPECT_NEAR(quality_of(body), 0.5, kRounding);
  body.covariance.block<3, 3>(3, 3) = Eigen::Matrix3d::Identity() * 0.04 * 0.04;
  EXPECT_NEAR(quality_of(body), 0.2, kRounding) << "the worse of the two counts";
  body.covariance(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_GE(quality_of(body), 0.0);
  body.valid = false;
  EXPECT_EQ(quality_of(body), 0.0);
}

TEST(ViconSubjectPoses, AllocateNothingAfterWarmUp) {
  const auto frame = make_scene_frame({"a", "b", "c"});
  for (const auto policy : {WhenInvalid::kFlag, WhenInvalid::kStop, WhenInvalid::kHold}) {
    auto poses = poses_with(policy);
    poses.update(*frame);
    const AllocationCounter allocations;
    for (int i = 0; i < 100; ++i) poses.update(*frame);
    EXPECT_EQ(allocations.count(), 0u);
  }
}

}  // namespace
}  // namespace fiducap::vicon
