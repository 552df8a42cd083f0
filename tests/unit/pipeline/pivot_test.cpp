#include "pipeline/body_pose.hpp"

#include <gtest/gtest.h>

#include <random>

#include "base/pose.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kPivotRounding = 1e-12;

BodyEstimate turning_body() {
  BodyEstimate body;
  body.X_WB = {exp_so3({0.2, -0.4, 0.9}), {1, -2, 0.5}};
  body.v_WB = {0.3, 0.1, -0.2};
  body.w_WB_B = {0.5, -1.0, 2.0};
  body.a_WB = {0.1, 0.2, 0.3};
  return body;
}

const Pose kPivot{exp_so3({0.1, 0.7, -0.3}), {0.2, -0.1, 0.05}};

TEST(Pivot, OnTheBodyAxesChangesNothing) {
  auto body = turning_body();
  body.covariance.diagonal().setLinSpaced(15, 1, 15);
  BodyPose out;
  write_pivot(body, Pose{}, 0.0, out);
  EXPECT_EQ(out.X_WP.p, body.X_WB.p);
  EXPECT_EQ(out.v_WP, body.v_WB);
  EXPECT_EQ(out.w_WP_P, body.w_WB_B);
  EXPECT_EQ(out.a_WP, body.a_WB);
  VectorXd expected(12);
  expected << 1, 2, 3, 4, 5, 6, 7, 8, 9, 13, 14, 15;
  EXPECT_LT((out.covariance.diagonal() - expected).norm(), kPivotRounding);
}

// A steady turn about z: every part can be written down by hand.
TEST(Pivot, HasTheVelocityAndCentripetalAccelerationOfARotation) {
  BodyEstimate body;
  body.X_WB.q = exp_so3({0, 0, M_PI / 2});
  body.w_WB_B = {0, 0, 2};
  BodyPose out;
  write_pivot(body, Pose{exp_so3({M_PI / 2, 0, 0}), {0.5, 0, 0}}, 0.0, out);
  EXPECT_LT((out.X_WP.p - Vector3d(0, 0.5, 0)).norm(), kPivotRounding);
  EXPECT_LT((out.v_WP - Vector3d(-1, 0, 0)).norm(), kPivotRounding);
  EXPECT_LT((out.a_WP - Vector3d(0, -2, 0)).norm(), kPivotRounding);
  EXPECT_LT((out.w_WP_P - Vector3d(0, 2, 0)).norm(), kPivotRounding);  // P's y is B's z
}

// Central differences of the pose along a turn of constant rate must give the twist.
TEST(Pivot, VelocityAndAccelerationAreTheDerivativesOfThePosition) {
  const auto at = [](double t) {
    auto body = turning_body();
    body.X_WB.q = body.X_WB.q * exp_so3(body.w_WB_B * t);
    body.X_WB.p += body.v_WB * t + 0.5 * body.a_WB * t * t;
    body.v_WB += body.a_WB * t;
    BodyPose out;
    write_pivot(body, kPivot, 0.0, out);
    return out;
  };
  constexpr double kStep_s = 1e-4;
  constexpr double kDifference = 1e-6;  // third derivative · step² of a few m/s³
  const auto before = at(-kStep_s);
  const auto now = at(0);
  const auto after = at(kStep_s);
  EXPECT_LT((now.v_WP - (after.X_WP.p - before.X_WP.p) / (2 * kStep_s)).norm(), kDifference);
  EXPECT_LT((now.a_WP - (after.v_WP - before.v_WP) / (2 * kStep_s)).norm(), kDifference);
  const Vector3d turn = log_so3(before.X_WP.q.conjugate() * after.X_WP.q) / (2 * kStep_s);
  EXPECT_LT((now.w_WP_P - turn).norm(), kDifference);
}

TEST(Pivot, CovarianceIsPropagatedByTheJacobian) {
  auto body = turning_body();
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const Matrix15d A = Matrix15d::NullaryExpr([&] { return normal(random); });
  body.covariance = A * A.transpose();
  BodyPose out;
  write_pivot(body, kPivot, 0.0, out);
  const Eigen::MatrixXd J = central_differences(
      [&](const VectorXd& d) {
        auto e = body;
        e.X_WB.p += d.segment<3>(estimate_block::kPosition);
        e.X_WB.q = exp_so3(d.segment<3>(estimate_block::kAttitude)) * e.X_WB.q;
        e.v_WB += d.segment<3>(estimate_block::kVelocity);
        e.w_WB_B -= d.segment<3>(estimate_block::kBiasW);
        BodyPose moved;
        write_pivot(e, kPivot, 0.0, moved);
        VectorXd error(12);
        error << moved.X_WP.p - out.X_WP.p, log_so3(moved.X_WP.q * out.X_WP.q.conjugate()),
            moved.v_WP - out.v_WP, moved.w_WP_P - out.w_WP_P;
        return error;
      },
      15);
  const Eigen::MatrixXd expected = propagated(J, body.covariance);
  EXPECT_LT((out.covariance - expected).norm(), 1e-7 * expected.norm());
}

TEST(Pivot, GyroNoiseReachesRateAndLeverArmVelocity) {
  BodyEstimate body;
  BodyPose out;
  write_pivot(body, Pose{Eigen::Quaterniond::Identity(), {0.5, 0, 0}}, 0.04, out);
  VectorXd expected = VectorXd::Zero(12);
  expected.segment<3>(6) << 0, 0.01, 0.01;
  expected.segment<3>(9).setConstant(0.04);
  EXPECT_LT((out.covariance.diagonal() - expected).norm(), kPivotRounding);
}

TEST(BodyPose, SigmaIsTheWorstAxis) {
  BodyPose pose;
  pose.covariance.diagonal().head<6>() << 0.01, 0.04, 0.02, 0.09, 0.01, 0.01;
  EXPECT_DOUBLE_EQ(pose.position_sigma_m(), 0.2);
  EXPECT_DOUBLE_EQ(pose.rotation_sigma_rad(), 0.3);
}

}  // namespace
}  // namespace fiducap
