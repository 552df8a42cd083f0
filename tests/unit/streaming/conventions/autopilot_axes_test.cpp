#include "streaming/conventions/autopilot_axes.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "base/so3.hpp"

namespace fiducap {
namespace {

constexpr double kRounding = 1e-12;
// Central differences with a step of 1e-6 on numbers of order one.
constexpr double kDifference = 1e-6;

Eigen::Vector3d random_vector(std::mt19937& random, double scale = 1) {
  std::normal_distribution<double> normal(0, scale);
  return {normal(random), normal(random), normal(random)};
}

BodyPose random_body(std::mt19937& random) {
  BodyPose body;
  body.state = BodyState::kTracking;
  body.valid = true;
  body.X_WP = {exp_so3(random_vector(random)), random_vector(random)};
  body.v_WP = random_vector(random);
  body.w_WP_P = random_vector(random);
  Matrix12d root;
  for (int i = 0; i < 12; ++i) {
    for (int k = 0; k < 4; ++k) root.block<3, 1>(3 * k, i) = random_vector(random, 0.1);
  }
  body.covariance = root * root.transpose();
  return body;
}

TEST(AutopilotAxes, NorthIsTheWorkspacesYAndDownItsMinusZ) {
  BodyPose body;
  body.X_WP = {Eigen::Quaterniond::Identity(), {1, 2, 3}};
  EXPECT_TRUE(
      to_autopilot(body, AutopilotWorld::kNed).p_NF.isApprox(Eigen::Vector3d(2, 1, -3), kRounding));
  EXPECT_TRUE(to_autopilot(body, AutopilotWorld::kFrd)
                  .p_NF.isApprox(Eigen::Vector3d(1, -2, -3), kRounding));
}

TEST(AutopilotAxes, ALevelBodyFacingEastHasAYawOfNinetyDegrees) {
  BodyPose body;  // x forward along W's x: east
  body.X_WP = {Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()};
  const auto rpy = roll_pitch_yaw(to_autopilot(body, AutopilotWorld::kNed).q_NF);
  EXPECT_TRUE(rpy.isApprox(Eigen::Vector3d(0, 0, std::numbers::pi / 2), kRounding))
      << rpy.transpose();
  EXPECT_TRUE(to_autopilot(body, AutopilotWorld::kFrd)
                  .q_NF.isApprox(Eigen::Quaterniond::Identity(), kRounding));
}

TEST(AutopilotAxes, NoseUpIsAPositivePitchAndRightSideDownAPositiveRoll) {
  BodyPose body;
  body.X_WP = {exp_so3({0, -0.2, 0}), Eigen::Vector3d::Zero()};  // about y (left): minus is nose up
  EXPECT_NEAR(roll_pitch_yaw(to_autopilot(body, AutopilotWorld::kFrd).q_NF).y(), 0.2, kRounding);
  body.X_WP.q = exp_so3({0.3, 0, 0});  // about x: left side up
  EXPECT_NEAR(roll_pitch_yaw(to_autopilot(body, AutopilotWorld::kFrd).q_NF).x(), 0.3, kRounding);
}

class AutopilotAxesProperty : public testing::TestWithParam<AutopilotWorld> {};

TEST_P(AutopilotAxesProperty, VelocityInBothAxesIsTheSameVector) {
  std::mt19937 random(1);
  for (int i = 0; i < 100; ++i) {
    const auto told = to_autopilot(random_body(random), GetParam());
    EXPECT_TRUE((told.q_NF * told.v_NF_F).isApprox(told.v_NF, 1e-9));
    EXPECT_NEAR(told.q_NF.norm(), 1, kRounding);
    EXPECT_GE(told.q_NF.w(), 0);
  }
}

TEST_P(AutopilotAxesProperty, AttitudeMovesAsTheBodyRateSays) {
  std::mt19937 random(2);
  constexpr double kStep_s = 1e-6;
  for (int i = 0; i < 100; ++i) {
    BodyPose body = random_body(random);
    const auto before = to_autopilot(body, GetParam());
    body.X_WP.q = body.X_WP.q * exp_so3(body.w_WP_P * kStep_s);
    const auto after = to_autopilot(body, GetParam());
    const Eigen::Vector3d rate = log_so3(before.q_NF.conjugate() * after.q_NF) / kStep_s;
    EXPECT_TRUE(rate.isApprox(before.w_NF_F, 1e-4)) << rate.transpose();
  }
}

TEST_P(AutopilotAxesProperty, CovariancesKeepTheirEigenvaluesAndStaySymmetric) {
  std::mt19937 random(3);
  for (int i = 0; i < 100; ++i) {
    const BodyPose body = random_body(random);
    const auto told = to_autopilot(body, GetParam());
    const Matrix6d own = body.covariance.topLeftCorner<6, 6>();
    EXPECT_NEAR(told.pose_covariance.trace(), own.trace(), 1e-9);
    EXPECT_NEAR(told.pose_covariance.determinant() / own.determinant(), 1, 1e-6);
    EXPECT_TRUE(told.pose_covariance.isApprox(told.pose_covariance.transpose(), kRounding));
    const Eigen::Vector3d own_velocity = body.covariance.diagonal().segment<3>(6);
    EXPECT_NEAR(told.velocity_variance.sum(), own_velocity.sum(), 1e-9);
  }
}

INSTANTIATE_TEST_SUITE_P(Worlds, AutopilotAxesProperty,
                         testing::Values(AutopilotWorld::kNed, AutopilotWorld::kFrd),
                         [](const auto& world) {
                           return world.param == AutopilotWorld::kNed ? "Ned" : "Frd";
                         });

TEST(AutopilotAxes, YawVarianceOfALevelBodyIsThatAboutTheVertical) {
  BodyPose body;
  body.X_WP = {exp_so3({0, 0, 0.7}), Eigen::Vector3d::Zero()};
  body.covariance.diagonal() << 1, 2, 3, 4, 5, 6, 0, 0, 0, 0, 0, 0;
  EXPECT_NEAR(to_autopilot(body, AutopilotWorld::kFrd).pose_covariance(5, 5), 6, kRounding);
}

TEST(AutopilotAxes, RollVarianceIsAboutTheHeading) {
  BodyPose body;
  body.X_WP = {exp_so3({0, 0, std::numbers::pi / 2}), Eigen::Vector3d::Zero()};  // faces W's y
  body.covariance.diagonal() << 0, 0, 0, 4, 5, 6, 0, 0, 0, 0, 0, 0;
  const auto told = to_autopilot(body, AutopilotWorld::kFrd);
  EXPECT_NEAR(told.pose_covariance(3, 3), 5, 1e-9);  // its x axis is W's y
  EXPECT_NEAR(told.pose_covariance(4, 4), 4, 1e-9);
}

TEST(BodyTwistCovariance, JacobianIsThatOfCentralDifferences) {
  std::mt19937 random(4);
  for (int i = 0; i < 20; ++i) {
    const BodyPose body = random_body(random);
    const auto velocity_P = [&body](const Eigen::Matrix<double, 12, 1>& error) {
      const Eigen::Quaterniond q = exp_so3(error.segment<3>(3)) * body.X_WP.q;
      Eigen::Matrix<double, 6, 1> out;
      out << q.conjugate() * Eigen::Vector3d(body.v_WP + error.segment<3>(6)),
          body.w_WP_P + error.segment<3>(9);
      return out;
    };
    Eigen::Matrix<double, 6, 12> J;
    for (int k = 0; k < 12; ++k) {
      Eigen::Matrix<double, 12, 1> step = Eigen::Matrix<double, 12, 1>::Zero();
      step[k] = 1e-6;
      J.col(k) = (velocity_P(step) - velocity_P(-step)) / 2e-6;
    }
    const Matrix6d expected = J * body.covariance * J.transpose();
    EXPECT_TRUE(body_twist_covariance(body).isApprox(expected, kDifference));
  }
}

TEST(AutopilotQuality, FallsWithTheDoubtAndIsMinusOneWhenInvalid) {
  std::mt19937 random(5);
  BodyPose body = random_body(random);
  body.covariance = Matrix12d::Identity() * 1e-6;
  EXPECT_EQ(autopilot_quality(body), 100);
  body.covariance = Matrix12d::Identity() * 0.01;  // 10 cm
  EXPECT_EQ(autopilot_quality(body), 10);  // ten times the best; 5.7 degrees alone would give 17
  body.covariance = Matrix12d::Identity() * 1e6;
  EXPECT_EQ(autopilot_quality(body), 1);
  body.covariance = Matrix12d::Identity() * 1e-6;
  body.state = BodyState::kCoasting;
  EXPECT_EQ(autopilot_quality(body), 50);
  body.valid = false;
  EXPECT_EQ(autopilot_quality(body), -1);
}

}  // namespace
}  // namespace fiducap
