#include "base/pose.hpp"

#include <gtest/gtest.h>

#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

const std::vector<Eigen::Vector3d> kRotations{
    {0, 0, 0}, {1e-8, -2e-8, 0}, {1e-4, 0, 1e-4}, {0.3, -0.2, 0.9}, {2.0, 1.0, -2.0}};

constexpr double kRounding = 1e-12;

TEST(So3, LogUndoesExp) {
  for (const auto& r : kRotations)
    EXPECT_LT((log_so3(exp_so3(r)) - r).norm(), kRounding) << r.transpose();
}

TEST(So3, ExpTurnsByTheAngleAboutTheAxis) {
  const Eigen::Vector3d turned = exp_so3({0, 0, M_PI / 2}) * Eigen::Vector3d::UnitX();
  EXPECT_LT((turned - Eigen::Vector3d::UnitY()).norm(), kRounding);
}

TEST(So3, LeftJacobianMatchesDifferences) {
  for (const auto& r : kRotations) {
    expect_jacobian(left_jacobian_so3(r), [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      return log_so3(exp_so3(r + d) * exp_so3(r).conjugate());
    });
  }
}

TEST(So3, SkewIsTheCrossProduct) {
  const Eigen::Vector3d a(1, -2, 3), b(0.5, 4, -1);
  EXPECT_LT((skew(a) * b - a.cross(b)).norm(), kRounding);
}

TEST(Pose, InverseCancels) {
  const Pose X{exp_so3({0.4, -1.0, 0.2}), {1, 2, 3}};
  const Pose I = X * X.inverse();
  EXPECT_LT(I.p.norm(), kRounding);
  EXPECT_LT(angle_between(I.q, Eigen::Quaterniond::Identity()), 1e-9);
}

}  // namespace
}  // namespace fiducap
