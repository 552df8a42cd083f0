#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "base/pose.hpp"
#include "streaming/conventions/axes.hpp"

namespace fiducap {
namespace {

// Products of a few rotations: only rounding is allowed.
constexpr double kRounding = 1e-12;
// Sample covariance of 4000 draws against the transformed one: 1/sqrt(4000) = 1.6 %, five sigma.
constexpr double kSampling = 0.08;

const Eigen::Matrix3d kZDown = Eigen::Vector3d(1, -1, -1).asDiagonal();
const Eigen::Matrix3d kYUp = (Eigen::Matrix3d() << 1, 0, 0, 0, 0, 1, 0, -1, 0).finished();

Eigen::Vector3d random_vector(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return {normal(random), normal(random), normal(random)};
}

/// @param sigma  of the root of the covariance
BodyPose random_body(std::mt19937& random, double sigma = 1e-3) {
  BodyPose body;
  body.body_id = 7;
  body.state = BodyState::kCoasting;
  body.valid = true;
  body.X_WP = {exp_so3(random_vector(random)), random_vector(random)};
  body.v_WP = random_vector(random);
  body.w_WP_P = random_vector(random);
  body.a_WP = random_vector(random);
  std::normal_distribution<double> normal(0, sigma);
  const Matrix12d root = Matrix12d::NullaryExpr([&] { return normal(random); });
  body.covariance = root * root.transpose();
  return body;
}

/// One choice of axes, with the client's world and body axes by definition and not by the code
/// under test.
struct ClientAxes {
  OutputAxes axes;
  Eigen::Matrix3d world = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d body = Eigen::Matrix3d::Identity();
};

std::vector<ClientAxes> all_axes() {
  std::vector<ClientAxes> all;
  for (const UpAxis up : {UpAxis::kZ, UpAxis::kY, UpAxis::kDown}) {
    for (const AxesScope scope : {AxesScope::kWorld, AxesScope::kWorldAndBody}) {
      for (const double units : {1.0, 1000.0}) {
        ClientAxes client{{up, scope, units}};
        if (up == UpAxis::kY) client.world = kYUp;
        if (up == UpAxis::kDown) client.world = kZDown;
        if (scope == AxesScope::kWorldAndBody) client.body = client.world;
        all.push_back(client);
      }
    }
  }
  return all;
}

TEST(Axes, ZUpInMetresChangesNothing) {
  std::mt19937 random(1);
  const BodyPose body = random_body(random);
  const BodyPose out = to_client(body, {});
  EXPECT_EQ(out.X_WP.p, body.X_WP.p);
  EXPECT_EQ(out.X_WP.q.coeffs(), body.X_WP.q.coeffs());
  EXPECT_EQ(out.v_WP, body.v_WP);
  EXPECT_EQ(out.w_WP_P, body.w_WP_P);
  EXPECT_EQ(out.a_WP, body.a_WP);
  EXPECT_EQ(out.covariance, body.covariance);
  EXPECT_EQ(out.state, BodyState::kCoasting);
  EXPECT_EQ(out.body_id, 7);
}

TEST(Axes, BodyAndItsTipMoveAsInTheWorld) {
  std::mt19937 random(2);
  for (const auto& client : all_axes()) {
    const double units = client.axes.units_per_m;
    for (int i = 0; i < 20; ++i) {
      const BodyPose body = random_body(random);
      const BodyPose out = to_client(body, client.axes);
      const Eigen::Matrix3d R = client.world * body.X_WP.rotation() * client.body.transpose();
      EXPECT_LT((out.X_WP.p - units * (client.world * body.X_WP.p)).norm(), kRounding * units);
      EXPECT_LT((out.X_WP.rotation() - R).norm(), kRounding * 10);
      EXPECT_NEAR(out.X_WP.q.norm(), 1.0, kRounding);
      EXPECT_LT((out.v_WP - units * (client.world * body.v_WP)).norm(), kRounding * units);
      EXPECT_LT((out.w_WP_P - client.body * body.w_WP_P).norm(), kRounding);
      EXPECT_LT((out.a_WP - units * (client.world * body.a_WP)).norm(), kRounding * units * 10);
      const Eigen::Vector3d w_C = AxesChange(client.axes).world_rate(body.X_WP.q * body.w_WP_P);
      EXPECT_LT((out.X_WP.q * out.w_WP_P - w_C).norm(), kRounding * 10);
      // The client places the same arm, in its units and its body axes, on the pose it got.
      const Eigen::Vector3d arm_P = random_vector(random);
      const Eigen::Vector3d arm = units * (client.body * arm_P);
      const Eigen::Vector3d tip_W = body.X_WP * arm_P;
      EXPECT_LT((out.X_WP * arm - units * (client.world * tip_W)).norm(), kRounding * units * 10);
      const Eigen::Vector3d speed_W = body.v_WP + body.X_WP.q * body.w_WP_P.cross(arm_P);
      const Eigen::Vector3d speed = out.v_WP + out.X_WP.q * out.w_WP_P.cross(arm);
      EXPECT_LT((speed - units * (client.world * speed_W)).norm(), kRounding * units * 10);
    }
  }
}

using Vector12d = Eigen::Matrix<double, 12, 1>;

/// The body that differs from `mean` by the error `e` (blocks of BodyPose::covariance).
BodyPose disturbed(const BodyPose& mean, const Vector12d& e) {
  BodyPose body = mean;
  body.X_WP.p += e.segment<3>(0);
  body.X_WP.q = exp_so3(e.segment<3>(3)) * mean.X_WP.q;
  body.v_WP += e.segment<3>(6);
  body.w_WP_P += e.segment<3>(9);
  return body;
}

Vector12d difference(const BodyPose& a, const BodyPose& mean) {
  Vector12d e;
  e << a.X_WP.p - mean.X_WP.p, log_so3(a.X_WP.q * mean.X_WP.q.conjugate()), a.v_WP - mean.v_WP,
      a.w_WP_P - mean.w_WP_P;
  return e;
}

TEST(Axes, CovarianceIsThatOfTransformedSamples) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const auto& client : all_axes()) {
    const BodyPose mean = random_body(random);
    const Matrix12d root = mean.covariance.llt().matrixL();
    const BodyPose mean_out = to_client(mean, client.axes);
    constexpr int kDraws = 4000;
    Matrix12d sampled = Matrix12d::Zero();
    for (int i = 0; i < kDraws; ++i) {
      const Vector12d e = root * Vector12d::NullaryExpr([&] { return normal(random); });
      const auto d = difference(to_client(disturbed(mean, e), client.axes), mean_out);
      sampled += d * d.transpose() / kDraws;
    }
    // In units of the standard deviations, so that every block counts.
    const Vector12d sigma = mean_out.covariance.diagonal().cwiseSqrt();
    const Matrix12d error = sigma.cwiseInverse().asDiagonal() * (sampled - mean_out.covariance) *
                            sigma.cwiseInverse().asDiagonal();
    EXPECT_LT(error.cwiseAbs().maxCoeff(), kSampling);
    const Matrix12d& P = mean_out.covariance;
    const auto angular = [](const BodyPose& body) {
      const auto variances = body.covariance.diagonal();
      return variances.segment<3>(3).sum() + variances.segment<3>(9).sum();
    };
    EXPECT_NEAR(angular(mean_out), angular(mean), kRounding);
    EXPECT_LT((P - P.transpose()).norm(), kRounding * P.norm());
  }
}

// Central differences with a step of 1e-6 on numbers of order one.
constexpr double kDifference = 1e-6;

constexpr double kRootSigma = 0.1;

TEST(AutopilotAxes, NorthIsTheWorkspacesYAndDownItsMinusZ) {
  BodyPose body;
  body.X_WP.p = {1, 2, 3};
  const auto p_in = [&](AutopilotWorld world) { return to_autopilot(body, world).p_NF; };
  EXPECT_TRUE(p_in(AutopilotWorld::kNed).isApprox(Eigen::Vector3d(2, 1, -3), kRounding));
  EXPECT_TRUE(p_in(AutopilotWorld::kFrd).isApprox(Eigen::Vector3d(1, -2, -3), kRounding));
}

TEST(AutopilotAxes, YawPitchAndRollHaveTheAutopilotsSigns) {
  BodyPose body;  // x forward along W's x: east
  const auto q_in = [&](AutopilotWorld world) { return to_autopilot(body, world).q_NF; };
  const Eigen::Vector3d rpy = roll_pitch_yaw(q_in(AutopilotWorld::kNed));
  EXPECT_TRUE(rpy.isApprox(Eigen::Vector3d(0, 0, std::numbers::pi / 2), kRounding))
      << rpy.transpose();
  EXPECT_TRUE(q_in(AutopilotWorld::kFrd).isApprox(Eigen::Quaterniond::Identity(), kRounding));
  body.X_WP.q = exp_so3({0, -0.2, 0});  // about y (left): minus is nose up
  EXPECT_NEAR(roll_pitch_yaw(q_in(AutopilotWorld::kFrd)).y(), 0.2, kRounding);
  body.X_WP.q = exp_so3({0.3, 0, 0});  // about x: left side up
  EXPECT_NEAR(roll_pitch_yaw(q_in(AutopilotWorld::kFrd)).x(), 0.3, kRounding);
}

TEST(AutopilotAxes, KeepVelocityRateAndCovariance) {
  std::mt19937 random(1);
  constexpr double kStep_s = 1e-6;
  for (const AutopilotWorld world : {AutopilotWorld::kNed, AutopilotWorld::kFrd}) {
    for (int i = 0; i < 100; ++i) {
      BodyPose body = random_body(random, kRootSigma);
      const auto out = to_autopilot(body, world);
      EXPECT_TRUE((out.q_NF * out.v_NF_F).isApprox(out.v_NF, 1e-9));
      EXPECT_NEAR(out.q_NF.norm(), 1, kRounding);
      EXPECT_GE(out.q_NF.w(), 0);
      const Matrix6d own = body.covariance.topLeftCorner<6, 6>();
      EXPECT_NEAR(out.pose_covariance.trace(), own.trace(), 1e-9);
      EXPECT_NEAR(out.pose_covariance.determinant() / own.determinant(), 1, 1e-6);
      EXPECT_TRUE(out.pose_covariance.isApprox(out.pose_covariance.transpose(), kRounding));
      const Eigen::Vector3d own_velocity = body.covariance.diagonal().segment<3>(6);
      EXPECT_NEAR(out.velocity_variance.sum(), own_velocity.sum(), 1e-9);
      body.X_WP.q = body.X_WP.q * exp_so3(body.w_WP_P * kStep_s);
      const Eigen::Quaterniond q_later = to_autopilot(body, world).q_NF;
      const Eigen::Vector3d rate = log_so3(out.q_NF.conjugate() * q_later) / kStep_s;
      EXPECT_TRUE(rate.isApprox(out.w_NF_F, 1e-4)) << rate.transpose();
    }
  }
}

TEST(AutopilotAxes, VariancesOfALevelBodyAreAboutItsHeading) {
  BodyPose body;
  body.X_WP.q = exp_so3({0, 0, 0.7});
  body.covariance.diagonal() << 1, 2, 3, 4, 5, 6, 0, 0, 0, 0, 0, 0;
  EXPECT_NEAR(to_autopilot(body, AutopilotWorld::kFrd).pose_covariance(5, 5), 6, kRounding);
  body.X_WP.q = exp_so3({0, 0, std::numbers::pi / 2});  // its x axis is W's y
  const auto converted = to_autopilot(body, AutopilotWorld::kFrd);
  EXPECT_NEAR(converted.pose_covariance(3, 3), 5, 1e-9);
  EXPECT_NEAR(converted.pose_covariance(4, 4), 4, 1e-9);
}

TEST(BodyTwistCovariance, JacobianIsThatOfCentralDifferences) {
  std::mt19937 random(4);
  for (int i = 0; i < 20; ++i) {
    const BodyPose body = random_body(random, kRootSigma);
    const auto velocity_P = [&body](const Vector12d& error) {
      const Eigen::Quaterniond q = exp_so3(error.segment<3>(3)) * body.X_WP.q;
      Eigen::Matrix<double, 6, 1> out;
      out << q.conjugate() * Eigen::Vector3d(body.v_WP + error.segment<3>(6)),
          body.w_WP_P + error.segment<3>(9);
      return out;
    };
    Eigen::Matrix<double, 6, 12> J;
    for (int k = 0; k < 12; ++k) {
      const Vector12d step = 1e-6 * Vector12d::Unit(k);
      J.col(k) = (velocity_P(step) - velocity_P(-step)) / 2e-6;
    }
    const Matrix6d expected = J * body.covariance * J.transpose();
    EXPECT_TRUE(body_twist_covariance(body).isApprox(expected, kDifference));
  }
}

TEST(AutopilotQuality, FallsWithTheCovarianceAndIsMinusOneWhenInvalid) {
  BodyPose body;
  body.state = BodyState::kTracking;
  body.valid = true;
  // 0.01: 10 cm are ten times the best; 5.7 degrees alone would give 17.
  for (const auto& [variance, quality] :
       {std::pair{0.01, 10}, std::pair{1e6, 1}, std::pair{1e-6, 100}}) {
    body.covariance = Matrix12d::Identity() * variance;
    EXPECT_EQ(autopilot_quality(body), quality) << variance;
  }
  body.state = BodyState::kCoasting;
  EXPECT_EQ(autopilot_quality(body), 50);
  body.valid = false;
  EXPECT_EQ(autopilot_quality(body), -1);
}

}  // namespace
}  // namespace fiducap
