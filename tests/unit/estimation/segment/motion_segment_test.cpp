// Errors on the world's side, of poses and of a whole body.
#include "estimation/segment/motion_segment.hpp"

#include <gtest/gtest.h>

#include "base/pose.hpp"
#include "estimation/world/filter_state.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using namespace world::layout;  // NOLINT: the block names are the subject

constexpr double kRounding = 1e-12;

BodyMoment example_body() {
  BodyMoment body;
  body.at = instant_from_ns(7'000'000'000);
  body.X_WB = {exp_so3({0.4, -0.6, 1.1}), {4.2, -3.7, 0.9}};
  body.v_WB = {0.5, 0.3, -0.4};
  body.bias_f = {0.05, -0.04, 0.06};
  body.bias_w = {0.006, -0.004, 0.005};
  return body;
}

Vector6d example_error(double scale) {
  Vector6d error;
  error << 0.5, -1.2, 0.7, -0.6, 0.5, 0.6;
  return scale * error;
}

double difference(const BodyMoment& a, const BodyMoment& b) {
  return (a.X_WB.p - b.X_WB.p).norm() + angle_between(a.X_WB.q, b.X_WB.q) +
         (a.v_WB - b.v_WB).norm() + (a.bias_f - b.bias_f).norm() + (a.bias_w - b.bias_w).norm();
}

TEST(SegmentWorldError, OfAPoseIsInvertible) {
  const Pose X = example_body().X_WB;
  for (const double scale : {0.0, 1e-8, 1e-3, 1.0, 2.0}) {
    const Vector6d error = example_error(scale);
    EXPECT_LT((world::world_error_between(X, world::moved(X, error)) - error).norm(), kRounding)
        << scale;
  }
}

TEST(SegmentWorldError, OfABodyIsInvertible) {
  const BodyMoment body = example_body();
  for (const double scale : {0.0, 1e-8, 1e-3, 1.0}) {
    const Vector15d error = scale * Vector15d::LinSpaced(-0.9, 1.1);
    const BodyMoment other = moved(body, error);
    EXPECT_LT((error_between(body, other) - error).norm(), kRounding) << scale;
    EXPECT_LT(difference(moved(body, error_between(body, other)), other), kRounding);
    EXPECT_EQ(other.at, body.at);
  }
}

TEST(SegmentWorldError, IsTheSameForTheBodyAndATagThatMoveTogether) {
  const Pose G{exp_so3({0.2, 0.1, -0.9}), {3, -2, 1}};
  const BodyMoment body = example_body();
  const Pose tag{exp_so3({1.0, 0.3, -0.2}), {-6, 2, 1}};
  const Vector15d of_body = error_between(body, in_other_axes(G, body));
  const Vector6d of_tag = world::world_error_between(tag, G * tag);
  EXPECT_LT((of_body.head<6>() - of_tag).norm(), kRounding);
  EXPECT_LT(of_body.tail<9>().norm(), kRounding) << "velocity and biases are not affected";
}

TEST(SegmentWorldError, IsTransformedByTheAdjoint) {
  const Pose G{exp_so3({0.2, 0.1, -0.9}), {3, -2, 1}};
  const BodyMoment body = example_body();
  const Vector15d error = 0.4 * Vector15d::LinSpaced(-0.9, 1.1);
  const Vector15d there =
      error_between(in_other_axes(G, body), in_other_axes(G, moved(body, error)));
  const Vector6d pose = world::adjoint(G) * error.head<6>();
  EXPECT_LT((there.head<6>() - pose).norm(), kRounding);
  EXPECT_LT((there.segment<3>(kVelocity) - G.q * error.segment<3>(kVelocity)).norm(), kRounding);
  EXPECT_LT((there.tail<6>() - error.tail<6>()).norm(), kRounding);
}

/// The error after a small further motion.
Eigen::MatrixXd by_differences(const Vector6d& error) {
  const Pose X = example_body().X_WB;
  return central_differences(
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        return world::world_error_between(X, world::moved(world::moved(X, error), d));
      },
      6);
}

TEST(InverseLeftJacobian, MatchesDifferencesOfSmallErrors) {
  EXPECT_LT((inverse_left_jacobian(Vector6d::Zero()) - Matrix6d::Identity()).norm(), kRounding);
  constexpr double kThirdOrder = 1e-7;  // of 0.01 rad
  for (const double scale : {1e-8, 1e-3, 1e-2}) {
    const Vector6d error = example_error(scale);
    EXPECT_LT((inverse_left_jacobian(error) - by_differences(error)).cwiseAbs().maxCoeff(),
              kThirdOrder)
        << scale;
  }
}

TEST(InverseLeftJacobian, HasAnErrorBelowAThousandthAt300Milliradians) {
  constexpr double kPromised = 1e-3;
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(-1, 2, 2)}) {
    Vector6d error = example_error(1);
    error.tail<3>() = 0.3 * axis.normalized();
    const Eigen::MatrixXd expected = by_differences(error);
    const Eigen::MatrixXd off = inverse_left_jacobian(error) - expected;
    EXPECT_LT(off.norm(), kPromised * expected.topRightCorner(3, 3).norm()) << axis.transpose();
  }
}

}  // namespace
}  // namespace fiducap
