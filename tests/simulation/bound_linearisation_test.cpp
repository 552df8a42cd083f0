// The Jacobians of the bound against numerical differences.
#include <gtest/gtest.h>

#include <cmath>

#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"
#include "support/bound/linearisation.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap::bound {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

const Pose kX_WB{exp_so3({0.3, -0.5, 1.1}), {0.4, -0.2, 1.3}};
const Pose kX_WT{exp_so3({-0.7, 0.4, 2.0}), {2.1, 0.6, 0.9}};

Pose moved(const Pose& X, const Vector3d& position, const Vector3d& rotation) {
  return {exp_so3(rotation) * X.q, X.p + position};
}

/// A camera that sees kX_WT from kX_WB, with and without a lens.
CameraMount camera(Distortion lens) {
  CameraMount mount;
  mount.model = {752, 480, 460, 455, 371, 243, lens, {}};
  if (lens == Distortion::kRadialTangential)
    mount.model.coefficients = {-0.28, 0.07, 2e-4, 2e-5, 0};
  // Forward axis from the body towards the tag.
  const Vector3d z = (kX_WB.inverse() * kX_WT.p).normalized();
  Eigen::Matrix3d R_BV;
  R_BV.col(2) = z;
  R_BV.col(0) = z.cross(Vector3d::UnitY()).normalized();
  R_BV.col(1) = z.cross(R_BV.col(0));
  mount.X_BV = {Eigen::Quaterniond(R_BV) * exp_so3({0.1, -0.15, 0.3}), {0.05, -0.03, 0.08}};
  return mount;
}

class CornerRowsOf : public testing::TestWithParam<Distortion> {};

TEST_P(CornerRowsOf, AgreeWithDifferencesOfTheProjection) {
  const CameraMount mount = camera(GetParam());
  const RecordedTag tag{3, 0.2, kX_WT, 0, 0};
  constexpr double kNoise_px = 0.4;
  const CornerRows rows = corner_rows(kX_WB, mount, tag, kNoise_px);
  const auto pixels = [&](const Pose& X_WB, const Pose& X_BV, const Pose& X_WT) {
    VectorXd px(8);
    for (int i = 0; i < 4; ++i) {
      const Vector3d p_V = X_BV.inverse() * (X_WB.inverse() * (X_WT * tag_corner(i, tag.edge_m)));
      px.segment<2>(2 * i) = mount.model.project(p_V).value() / kNoise_px;
    }
    return px;
  };
  // Raw pixels of a lens are known to 1e-9 px through the iterated inverse; differences of 1e-5
  // make 1e-4 of it.
  constexpr double kTolerance = 1e-5;
  Eigen::Matrix<double, 8, 18> J;
  J << rows.position, rows.rotation, rows.extrinsics, rows.tag;
  expect_jacobian(
      J,
      [&](const VectorXd& d) {
        return pixels(moved(kX_WB, d.segment<3>(0), d.segment<3>(3)),
                      moved(mount.X_BV, d.segment<3>(6), d.segment<3>(9)),
                      moved(kX_WT, d.segment<3>(12), d.segment<3>(15)));
      },
      kTolerance);
}

INSTANTIATE_TEST_SUITE_P(Lenses, CornerRowsOf,
                         testing::Values(Distortion::kNone, Distortion::kRadialTangential));

TEST(RelativeRowsOf, TagAgreeWithDifferences) {
  const Pose X_TB = kX_WT.inverse() * kX_WB;
  expect_jacobian(relative_to_tag(kX_WB, kX_WT), [&](const VectorXd& d) {
    const Pose moved_TB = moved(kX_WT, d.segment<3>(6), d.segment<3>(9)).inverse() *
                          moved(kX_WB, d.segment<3>(3), d.segment<3>(0));
    VectorXd e(6);
    e << moved_TB.p - X_TB.p, log_so3(moved_TB.q * X_TB.q.conjugate());
    return e;
  });
}

TEST(RelativeRowsOf, LevelAxesAgreeWithDifferences) {
  const int axis = heading_axis(kX_WT.q);
  const auto level_from = [&](const Pose& X_WT) {
    const Vector3d h = X_WT.q * Vector3d::Unit(axis);
    return Pose{exp_so3({0, 0, std::atan2(h.y(), h.x())}), X_WT.p};
  };
  // Errors in axes that stay parallel to W: the level axes at zero perturbation are turned back.
  const Pose X_WL = level_from(kX_WT);
  const Pose X_LB = X_WL.inverse() * kX_WB;
  expect_jacobian(relative_to_level(kX_WB, kX_WT, axis), [&](const VectorXd& d) {
    const Pose moved_LB = level_from(moved(kX_WT, d.segment<3>(6), d.segment<3>(9))).inverse() *
                          moved(kX_WB, d.segment<3>(3), d.segment<3>(0));
    VectorXd e(6);
    e << X_WL.q * (moved_LB.p - X_LB.p), X_WL.q * log_so3(moved_LB.q * X_LB.q.conjugate());
    return e;
  });
}

/// Truth under constant specific force (W axes) and rate, with errors put into the start and the
/// biases.
TruthSample carried(const TruthSample& from, const VectorXd& d, const Vector3d& force_W,
                    const Vector3d& w_B, double dt) {
  // IMU samples of the unperturbed motion; the perturbed one subtracts its own biases. Many small
  // steps.
  constexpr int kSteps = 2000;
  const double h = dt / kSteps;
  Pose true_X = from.X_WB;
  TruthSample s = from;
  s.X_WB = moved(from.X_WB, d.segment<3>(kPosition), d.segment<3>(kRotation));
  s.v_WB += d.segment<3>(kVelocity);
  for (int i = 0; i < kSteps; ++i) {
    const Eigen::Quaterniond true_middle = true_X.q * exp_so3(0.5 * h * w_B);
    const Vector3d f_B = true_middle.conjugate() * force_W - d.segment<3>(kBiasF);
    const Vector3d w = w_B - d.segment<3>(kBiasW);
    const Vector3d a = (s.X_WB.q * exp_so3(0.5 * h * w)) * f_B - Vector3d(0, 0, 9.81);
    s.X_WB.p += h * s.v_WB + 0.5 * h * h * a;
    s.v_WB += h * a;
    s.X_WB.q = s.X_WB.q * exp_so3(h * w);
    true_X.q = true_X.q * exp_so3(h * w_B);
  }
  s.at = from.at + from_seconds(dt);
  return s;
}

TEST(InertialStepOf, TruthAgreesWithDifferencesOfTheIntegration) {
  TruthSample from;
  from.X_WB = kX_WB;
  from.v_WB = {0.5, -1.0, 0.2};
  const Vector3d force_W(1.0, -2.0, 11.0);
  const Vector3d w_B(0.8, -1.5, 0.6);
  constexpr double kDt = 0.005;
  const TruthSample to = carried(from, VectorXd::Zero(15), force_W, w_B, kDt);
  const InertialStep step = inertial_step(from, to, ImuNoise{}, 9.81);
  const auto error = [&](const VectorXd& d) {
    const TruthSample end = carried(from, d, force_W, w_B, kDt);
    VectorXd e = d;
    e.segment<3>(kRotation) = log_so3(end.X_WB.q * to.X_WB.q.conjugate());
    e.segment<3>(kVelocity) = end.v_WB - to.v_WB;
    e.segment<3>(kPosition) = end.X_WB.p - to.X_WB.p;
    return e;
  };
  // The turn within the step (8 mrad) is taken as half done: second order of it.
  constexpr double kTolerance = 1e-6;
  expect_jacobian(step.Phi, error, kTolerance);
}

TEST(InertialStepOf, TwoHalvesAreOneWhole) {
  TruthSample a;
  a.X_WB = kX_WB;
  a.v_WB = {0.5, -1.0, 0.2};
  const Vector3d force_W(1.0, -2.0, 11.0);
  const TruthSample b = carried(a, VectorXd::Zero(15), force_W, Vector3d::Zero(), 0.0025);
  const TruthSample c = carried(b, VectorXd::Zero(15), force_W, Vector3d::Zero(), 0.0025);
  const ImuNoise noise;
  const InertialStep first = inertial_step(a, b, noise, 9.81);
  const InertialStep second = inertial_step(b, c, noise, 9.81);
  const InertialStep whole = inertial_step(a, c, noise, 9.81);
  const Matrix15 Q = second.Phi * first.Q * second.Phi.transpose() + second.Q;
  // Without rotation the transition is exact; of the noise, what is integrated twice (position by
  // accelerometer) is too.
  constexpr double kRounding = 1e-12;
  EXPECT_LT((second.Phi * first.Phi - whole.Phi).cwiseAbs().maxCoeff(), kRounding);
  for (int i = kRotation; i < kBiasW + 6; ++i)
    EXPECT_NEAR(Q(i, i), whole.Q(i, i), 1e-6 * whole.Q(i, i)) << "row " << i;
}

}  // namespace
}  // namespace fiducap::bound
