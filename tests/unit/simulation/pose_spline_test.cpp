#include "simulation/motion/motion.hpp"

#include <gtest/gtest.h>

#include "base/pose.hpp"
#include "simulation/random.hpp"

namespace fiducap::simulation {
namespace {

// Central differences with a step of 1e-4: the cubic error term and rounding stay below this, any
// wrong term does not.
constexpr double kDifferences = 2e-6;

/// One round with a full turn about z, so that q comes back as −q.
std::vector<Pose> one_round() {
  Random random(7, Purpose::kMotion);
  std::vector<Pose> poses;
  for (int i = 0; i < 12; ++i) {
    const double turn = 2 * std::numbers::pi * i / 12;
    const Eigen::Vector3d p =
        Eigen::Vector3d(std::cos(turn), std::sin(turn), 0) + 0.2 * random.normal3();
    poses.push_back({exp_so3({0, 0, turn}) * exp_so3(0.1 * random.normal3()), p});
  }
  return poses;
}

void expect_derivatives(const PoseSpline& spline, double s) {
  constexpr double kStep = 1e-4;
  const PoseSpline::Point before = spline.at(s - kStep);
  const PoseSpline::Point here = spline.at(s);
  const PoseSpline::Point after = spline.at(s + kStep);
  EXPECT_LT(((after.X.p - before.X.p) / (2 * kStep) - here.velocity).norm(), kDifferences)
      << "at " << s;
  EXPECT_LT(((after.velocity - before.velocity) / (2 * kStep) - here.acceleration).norm(),
            kDifferences)
      << "at " << s;
  const Eigen::Vector3d turned = log_so3(before.X.q.conjugate() * after.X.q);
  EXPECT_LT((turned / (2 * kStep) - here.rate).norm(), kDifferences) << "at " << s;
}

TEST(PoseSpline, DerivativesAreThoseOfTheCurve) {
  const PoseSpline spline(one_round(), 0.7, true);
  for (double s = 0.05; s < 1.2 * spline.length(); s += 0.173) expect_derivatives(spline, s);
}

TEST(PoseSpline, DerivativesAreRightWhereTheRoundCloses) {
  const PoseSpline spline(one_round(), 0.7, true);
  for (const double s : {0.0, 1e-5, spline.length() - 1e-5, spline.length(), 3 * spline.length()}) {
    expect_derivatives(spline, s);
  }
}

TEST(PoseSpline, AClosedSplineRepeats) {
  const PoseSpline spline(one_round(), 0.7, true);
  const PoseSpline::Point first = spline.at(1.3);
  const PoseSpline::Point later = spline.at(1.3 + 5 * spline.length());
  constexpr double kRounding = 1e-12;
  EXPECT_LT((first.X.p - later.X.p).norm(), kRounding);
  EXPECT_LT(angle_between(first.X.q, later.X.q), 1e-7);  // acos of a number next to 1
}

TEST(PoseSpline, WeightsAddUpToOneAndTheirDerivativesToZero) {
  for (double u = 0; u <= 1.0; u += 0.125) {
    EXPECT_NEAR(PoseSpline::weights(u, 0).sum(), 1.0, 1e-14);
    EXPECT_NEAR(PoseSpline::weights(u, 1).sum(), 0.0, 1e-14);
    EXPECT_NEAR(PoseSpline::weights(u, 2).sum(), 0.0, 1e-14);
    EXPECT_GT(PoseSpline::weights(u, 0).minCoeff(), -1e-15);
  }
}

TEST(PoseSpline, AStandingControlPoseGivesAStandingBody) {
  const Pose here{exp_so3({0.1, 0.2, 0.3}), {1, 2, 3}};
  const PoseSpline spline(std::vector<Pose>(8, here), 0.5, false);
  const PoseSpline::Point point = spline.at(0.61);
  EXPECT_LT((point.X.p - here.p).norm(), 1e-13);
  EXPECT_LT(point.velocity.norm() + point.acceleration.norm() + point.rate.norm(), 1e-12);
}

}  // namespace
}  // namespace fiducap::simulation
