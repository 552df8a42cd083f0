#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "base/pose.hpp"
#include "streaming/conventions/axes.hpp"

namespace fiducap {
namespace {

// Products of a handful of rotations: only rounding is allowed.
constexpr double kRounding = 1e-12;
// Sample covariance of 4000 draws against the transformed one: 1/sqrt(4000) = 1.6 %, five sigma.
constexpr double kSampling = 0.08;

const Eigen::Matrix3d kZDown = Eigen::Vector3d(1, -1, -1).asDiagonal();
const Eigen::Matrix3d kYUp = (Eigen::Matrix3d() << 1, 0, 0, 0, 0, 1, 0, -1, 0).finished();

Eigen::Vector3d random_vector(std::mt19937& random, double scale = 1) {
  std::normal_distribution<double> normal(0, scale);
  return {normal(random), normal(random), normal(random)};
}

BodyPose random_body(std::mt19937& random) {
  BodyPose body;
  body.body_id = 7;
  body.state = BodyState::kCoasting;
  body.valid = true;
  body.X_WP = {exp_so3(random_vector(random)), random_vector(random)};
  body.v_WP = random_vector(random);
  body.w_WP_P = random_vector(random);
  body.a_WP = random_vector(random);
  const Matrix12d root =
      Matrix12d::NullaryExpr([&] { return 1e-3 * std::normal_distribution<double>()(random); });
  body.covariance = root * root.transpose();
  return body;
}

std::vector<OutputAxes> all_axes() {
  std::vector<OutputAxes> all;
  for (const UpAxis up : {UpAxis::kZ, UpAxis::kY, UpAxis::kDown}) {
    for (const AxesScope scope : {AxesScope::kWorld, AxesScope::kWorldAndBody}) {
      for (const double units : {1.0, 1000.0}) all.push_back({up, scope, units});
    }
  }
  return all;
}

/// World axes of the client from W, by definition and not by the code under test.
Eigen::Matrix3d world(const OutputAxes& axes) {
  if (axes.up == UpAxis::kY) return kYUp;
  return axes.up == UpAxis::kDown ? kZDown : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}
Eigen::Matrix3d body_axes(const OutputAxes& axes) {
  return axes.scope == AxesScope::kWorldAndBody ? world(axes)
                                                : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
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

TEST(Axes, YUpPutsTheHeightIntoY) {
  BodyPose body;
  body.X_WP.p = {1, 2, 3};
  EXPECT_EQ(to_client(body, {UpAxis::kY}).X_WP.p, Eigen::Vector3d(1, 3, -2));
  EXPECT_EQ(to_client(body, {UpAxis::kY, AxesScope::kWorld, 1000}).X_WP.p,
            Eigen::Vector3d(1000, 3000, -2000));
}

TEST(Axes, ForwardLeftUpBecomesForwardRightDown) {
  BodyPose body;
  body.X_WP = {exp_so3({0, 0, 0.7}), {1, 2, 3}};  // heading to the left
  body.w_WP_P = {0, 0, 1};
  const auto out = to_client(body, {UpAxis::kDown, AxesScope::kWorldAndBody});
  EXPECT_EQ(out.X_WP.p, Eigen::Vector3d(1, -2, -3));
  EXPECT_LT(angle_between(out.X_WP.q, exp_so3({0, 0, -0.7})), 1e-9)
      << "to the left is against the clock's yaw";
  EXPECT_EQ(out.w_WP_P, Eigen::Vector3d(0, 0, -1));
}

TEST(Axes, ALevelBodyIsLevelInYUpWorldAndBody) {
  BodyPose body;
  body.X_WP.q = exp_so3({0, 0, 0.7});  // heading 0.7 rad
  const auto world_only = to_client(body, {UpAxis::kY, AxesScope::kWorld});
  const auto both = to_client(body, {UpAxis::kY, AxesScope::kWorldAndBody});
  // The body's own z stays its up in the first case, in the second its y is up.
  EXPECT_LT((world_only.X_WP.q * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitY()).norm(),
            kRounding);
  EXPECT_LT((both.X_WP.q * Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitY()).norm(), kRounding);
  EXPECT_LT(angle_between(both.X_WP.q, exp_so3({0, 0.7, 0})), 1e-9);
}

TEST(Axes, AVectorFixedInTheBodyTurnsLikeTheWorld) {
  std::mt19937 random(2);
  for (const auto& axes : all_axes()) {
    for (int i = 0; i < 20; ++i) {
      const BodyPose body = random_body(random);
      const BodyPose out = to_client(body, axes);
      const Eigen::Vector3d arm_P = random_vector(random);
      const Eigen::Vector3d tip_W = body.X_WP * arm_P;
      // The client places the same arm, in its units and its body axes, on the pose it got.
      const Eigen::Vector3d tip_client =
          out.X_WP * Eigen::Vector3d(axes.units_per_m * (body_axes(axes) * arm_P));
      EXPECT_LT((tip_client - axes.units_per_m * (world(axes) * tip_W)).norm(),
                kRounding * axes.units_per_m * 10);
      EXPECT_NEAR(out.X_WP.q.norm(), 1.0, kRounding);
    }
  }
}

TEST(Axes, VelocityAndRateMoveTheTipLikeTheWorld) {
  std::mt19937 random(3);
  for (const auto& axes : all_axes()) {
    const BodyPose body = random_body(random);
    const BodyPose out = to_client(body, axes);
    const Eigen::Vector3d arm_P = random_vector(random);
    const Eigen::Vector3d speed_W = body.v_WP + body.X_WP.q * body.w_WP_P.cross(arm_P);
    const Eigen::Vector3d arm_client = axes.units_per_m * (body_axes(axes) * arm_P);
    const Eigen::Vector3d speed_client = out.v_WP + out.X_WP.q * out.w_WP_P.cross(arm_client);
    EXPECT_LT((speed_client - axes.units_per_m * (world(axes) * speed_W)).norm(),
              kRounding * axes.units_per_m * 10);
    EXPECT_LT((out.a_WP - axes.units_per_m * (world(axes) * body.a_WP)).norm(),
              kRounding * axes.units_per_m * 10);
  }
}

TEST(Axes, WorldRateIsTheBodyRateSeenFromTheWorld) {
  std::mt19937 random(4);
  for (const auto& axes : all_axes()) {
    const BodyPose body = random_body(random);
    const BodyPose out = to_client(body, axes);
    const Eigen::Vector3d w_C = AxesChange(axes).world_rate(body.X_WP.q * body.w_WP_P);
    EXPECT_LT((out.X_WP.q * out.w_WP_P - w_C).norm(), kRounding * 10);
  }
}

/// What the client would see of one body that differs from `mean` by the error `e` (blocks of
/// BodyPose::covariance).
BodyPose disturbed(const BodyPose& mean, const Eigen::Matrix<double, 12, 1>& e) {
  BodyPose body = mean;
  body.X_WP.p += e.segment<3>(0);
  body.X_WP.q = exp_so3(e.segment<3>(3)) * mean.X_WP.q;
  body.v_WP += e.segment<3>(6);
  body.w_WP_P += e.segment<3>(9);
  return body;
}

Eigen::Matrix<double, 12, 1> difference(const BodyPose& a, const BodyPose& mean) {
  Eigen::Matrix<double, 12, 1> e;
  e << a.X_WP.p - mean.X_WP.p, log_so3(a.X_WP.q * mean.X_WP.q.conjugate()), a.v_WP - mean.v_WP,
      a.w_WP_P - mean.w_WP_P;
  return e;
}

TEST(Axes, CovarianceIsThatOfTransformedSamples) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const auto& axes : all_axes()) {
    const BodyPose mean = random_body(random);
    const Matrix12d root = mean.covariance.llt().matrixL();
    const BodyPose mean_out = to_client(mean, axes);
    constexpr int kDraws = 4000;
    Matrix12d sampled = Matrix12d::Zero();
    for (int i = 0; i < kDraws; ++i) {
      const Eigen::Matrix<double, 12, 1> e =
          root * Eigen::Matrix<double, 12, 1>::NullaryExpr([&] { return normal(random); });
      const auto d = difference(to_client(disturbed(mean, e), axes), mean_out);
      sampled += d * d.transpose() / kDraws;
    }
    // In units of the standard deviations, so that every block counts.
    const Eigen::Matrix<double, 12, 1> sigma = mean_out.covariance.diagonal().cwiseSqrt();
    const Matrix12d error = sigma.cwiseInverse().asDiagonal() * (sampled - mean_out.covariance) *
                            sigma.cwiseInverse().asDiagonal();
    EXPECT_LT(error.cwiseAbs().maxCoeff(), kSampling);
  }
}

TEST(Axes, CanBeUndone) {
  std::mt19937 random(6);
  for (const auto& axes : all_axes()) {
    const BodyPose body = random_body(random);
    const BodyPose out = to_client(body, axes);
    const Eigen::Matrix3d F = world(axes).transpose();
    const Eigen::Matrix3d G = body_axes(axes);
    EXPECT_LT((F * out.X_WP.p / axes.units_per_m - body.X_WP.p).norm(), kRounding);
    EXPECT_LT((F * out.X_WP.rotation() * G - body.X_WP.rotation()).norm(), kRounding * 10);
    EXPECT_LT((F * out.v_WP / axes.units_per_m - body.v_WP).norm(), kRounding);
    EXPECT_LT((G.transpose() * out.w_WP_P - body.w_WP_P).norm(), kRounding);
    const auto angular = [](const Matrix12d& P) {
      return Eigen::Matrix3d(P.block<3, 3>(3, 3)).trace() +
             Eigen::Matrix3d(P.block<3, 3>(9, 9)).trace();
    };
    EXPECT_NEAR(angular(out.covariance), angular(body.covariance), kRounding);
    EXPECT_LT((out.covariance - out.covariance.transpose()).norm(),
              kRounding * out.covariance.norm());
  }
}

// Central differences with a step of 1e-6 on numbers of order one.
constexpr double kDifference = 1e-6;

BodyPose tracking_body(std::mt19937& random) {
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
    const auto converted = to_autopilot(tracking_body(random), GetParam());
    EXPECT_TRUE((converted.q_NF * converted.v_NF_F).isApprox(converted.v_NF, 1e-9));
    EXPECT_NEAR(converted.q_NF.norm(), 1, kRounding);
    EXPECT_GE(converted.q_NF.w(), 0);
  }
}

TEST_P(AutopilotAxesProperty, AttitudeMovesAsTheBodyRateSays) {
  std::mt19937 random(2);
  constexpr double kStep_s = 1e-6;
  for (int i = 0; i < 100; ++i) {
    BodyPose body = tracking_body(random);
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
    const BodyPose body = tracking_body(random);
    const auto converted = to_autopilot(body, GetParam());
    const Matrix6d own = body.covariance.topLeftCorner<6, 6>();
    EXPECT_NEAR(converted.pose_covariance.trace(), own.trace(), 1e-9);
    EXPECT_NEAR(converted.pose_covariance.determinant() / own.determinant(), 1, 1e-6);
    EXPECT_TRUE(
        converted.pose_covariance.isApprox(converted.pose_covariance.transpose(), kRounding));
    const Eigen::Vector3d own_velocity = body.covariance.diagonal().segment<3>(6);
    EXPECT_NEAR(converted.velocity_variance.sum(), own_velocity.sum(), 1e-9);
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
  const auto converted = to_autopilot(body, AutopilotWorld::kFrd);
  EXPECT_NEAR(converted.pose_covariance(3, 3), 5, 1e-9);  // its x axis is W's y
  EXPECT_NEAR(converted.pose_covariance(4, 4), 4, 1e-9);
}

TEST(BodyTwistCovariance, JacobianIsThatOfCentralDifferences) {
  std::mt19937 random(4);
  for (int i = 0; i < 20; ++i) {
    const BodyPose body = tracking_body(random);
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
  BodyPose body = tracking_body(random);
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
