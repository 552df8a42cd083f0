#include <gmock/gmock.h>

#include <limits>
#include <random>

#include "base/pose.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/vicon/frame_board.hpp"
#include "support/allocation_counter.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vicon {
namespace {

constexpr double kRounding = 1e-12;  // of products of numbers around 1
constexpr double kSubjectRounding_mm = 1e-9;
constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

class ViconSubjectPoses : public testing::Test {
 protected:
  static SubjectPoses make(WhenInvalid when_invalid) {
    return SubjectPoses(conventions_of("vicon").axes, when_invalid);
  }
  void update() { poses_.update(*frame_); }
  [[nodiscard]] const auto& first() const { return poses_.all()[0]; }
  BodyPose& body() { return frame_->bodies[0]; }

  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"a", "b"});
  SubjectPoses poses_ = make(WhenInvalid::kFlag);
};

TEST_F(ViconSubjectPoses, RotateSegmentPointsIntoTheWorldInMillimetres) {
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  for (int i = 0; i < 200; ++i) {
    // Also attitudes half a turn away, tiny ones, and quaternions with a negative real part.
    Pose& X_WP = body().X_WP;
    X_WP = {exp_so3((i % 4 == 0 ? 1e-9 : 2.0) * vector()), 5 * vector()};
    if (i % 2 == 0) X_WP.q.coeffs() *= -1;
    update();
    const SegmentPose& segment = first().segment;
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

TEST_F(ViconSubjectPoses, ListAnInvalidBodyAsNotVisible) {
  body().valid = false;
  update();
  EXPECT_TRUE(first().listed);
  EXPECT_FALSE(first().visible);
  EXPECT_EQ(first().quality, 0.0);
  EXPECT_TRUE(poses_.all()[1].visible);
  poses_ = make(WhenInvalid::kStop);
  update();
  EXPECT_FALSE(first().listed);
  EXPECT_FALSE(first().visible);
}

TEST_F(ViconSubjectPoses, RepeatTheLastValidPoseWithHold) {
  poses_ = make(WhenInvalid::kHold);
  body().valid = false;
  update();
  EXPECT_FALSE(first().visible) << "no pose yet";
  body().valid = true;
  update();
  const Eigen::Vector3d seen = first().segment.t_mm;
  body().valid = false;
  body().X_WP.p += Eigen::Vector3d::Ones();
  update();
  EXPECT_TRUE(first().visible);
  EXPECT_EQ(first().segment.t_mm, seen);
  EXPECT_EQ(first().quality, 0.0);
  frame_->axes = 1;
  update();
  EXPECT_FALSE(first().visible) << "held in axes that are no longer those of the room";
}

TEST_F(ViconSubjectPoses, NonFiniteNumbersMakeABodyInvalid) {
  body().X_WP.p.x() = kNotANumber;
  frame_->bodies[1].X_WP.q.w() = std::numeric_limits<double>::infinity();
  update();
  EXPECT_FALSE(first().visible);
  EXPECT_FALSE(poses_.all()[1].visible);
}

TEST_F(ViconSubjectPoses, QualityDecreasesFromOneWithTheCovariance) {
  BodyPose one;
  one.valid = true;
  EXPECT_EQ(quality_of(one), 1.0);
  one.covariance.block<3, 3>(0, 0) = Eigen::Matrix3d::Identity() * 0.02 * 0.02;
  EXPECT_NEAR(quality_of(one), 0.5, kRounding);
  one.covariance.block<3, 3>(3, 3) = Eigen::Matrix3d::Identity() * 0.04 * 0.04;
  EXPECT_NEAR(quality_of(one), 0.2, kRounding) << "the worse of the two counts";
  one.covariance(0, 0) = kNotANumber;
  EXPECT_GE(quality_of(one), 0.0);
  one.valid = false;
  EXPECT_EQ(quality_of(one), 0.0);
}

TEST_F(ViconSubjectPoses, AllocateNothingAfterWarmUp) {
  for (const auto policy : {WhenInvalid::kFlag, WhenInvalid::kStop, WhenInvalid::kHold}) {
    poses_ = make(policy);
    update();
    const AllocationCounter allocations;
    for (int i = 0; i < 100; ++i) update();
    EXPECT_EQ(allocations.count(), 0u);
  }
}

}  // namespace
}  // namespace fiducap::vicon
