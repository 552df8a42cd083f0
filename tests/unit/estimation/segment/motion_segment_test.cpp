// Errors on the world's side, of poses and of a whole body; a path is cut into segments.
#include "estimation/segment/motion_segment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "estimation/segment/segment_cutting.hpp"
#include "estimation/world/filter_state.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using std::chrono::milliseconds;

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

TEST(SegmentWorldError, OfABodyIsInvertible) {
  const BodyMoment body = example_body();
  for (const double scale : {0.0, 1e-8, 1e-3, 1.0, 2.0}) {
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

/// A body that walks along x, 10 images a second, each with tag 1 and a tag without a pose.
class SegmentCuttingTest : public testing::Test {
 protected:
  SegmentCuttingTest() {
    path_.head.body_id = 3;
    path_.head.chain = 5;
    path_.head.sensors = std::make_shared<const SegmentSensors>();
    path_.motion = motion_without_imu({});
    path_.head.cameras.resize(1);
    path_.tags[1] = {1, 0.2, {}, Matrix6d::Zero()};
  }
  void walk(int from_ms, int images) {
    for (int i = 0; i < images; ++i) {
      const Instant at = Instant{} + milliseconds(from_ms + 100 * i);
      const double s = to_seconds(at - Instant{});
      SegmentImage image;
      image.tags.resize(2);
      image.tags[0].seen.tag_id = 1;
      image.tags[1].seen.tag_id = 2;
      path_.instants.push_back({at, {exp_so3({0, 0, 0.2 * s}), {s, 0, 0}}, {image}});
    }
  }
  PlacedPath path_;
};

TEST_F(SegmentCuttingTest, CutsAfterASecondWithoutGapsAndEveryImageIsInOneSegment) {
  walk(0, 26);
  const auto segments = cut_segments(path_);
  ASSERT_EQ(segments.size(), 3U);
  std::size_t images = 0;
  for (const MotionSegment& segment : segments) {
    EXPECT_EQ(segment.body_id, 3);
    EXPECT_EQ(segment.chain, 5);
    ASSERT_EQ(segment.tags.size(), 1U) << "the other one has no pose";
    for (const MotionSegment::Instance& instance : segment.instances) {
      images += instance.images.size();
      double steps_s = 0;
      for (const SegmentStep& step : instance.steps) steps_s += step.dt_s;
      EXPECT_NEAR(steps_s, &instance == &segment.instances.front() ? 0 : 0.1, 1e-9);
    }
  }
  EXPECT_EQ(images, 26U);
  EXPECT_EQ(segments[0].end().at, segments[1].begin().at);
  EXPECT_EQ(segments[0].end().at - segments[0].begin().at, std::chrono::seconds(1));
}

TEST_F(SegmentCuttingTest, VelocitiesAreDifferencesOfNeighbours) {
  walk(0, 12);
  const BodyMoment body = cut_segments(path_).front().instances[4].body;
  EXPECT_LT((body.v_WB - Eigen::Vector3d(1, 0, 0)).norm(), 1e-9);
  EXPECT_LT((body.bias_w - Eigen::Vector3d(0, 0, -0.2)).norm(), 1e-9);
}

/// Odometry of a body on a circle, in its own axes.
Odometry on_a_circle(double seconds) {
  Odometry out;
  for (double s = 0; s <= seconds; s += 0.5)
    out.poses.push_back({Instant{} + from_seconds(s),
                         {exp_so3({0, 0, 0.3 * s}), {std::sin(0.3 * s), -std::cos(0.3 * s), 2}}});
  return out;
}

TEST_F(SegmentCuttingTest, AChainEndsAfterALongTimeWithoutTagsAndOdometry) {
  walk(0, 5);
  walk(20'000, 5);
  const Odometry odometry = on_a_circle(10);
  for (const Odometry* used : {static_cast<const Odometry*>(nullptr), &odometry}) {
    path_.odometry = used;
    const auto segments = cut_segments(path_);
    ASSERT_EQ(segments.size(), 2U);
    EXPECT_NE(segments[0].chain, segments[1].chain);
  }
}

TEST_F(SegmentCuttingTest, OdometryBridgesALongTimeWithoutTags) {
  walk(0, 5);
  walk(60'250, 5);
  const Odometry odometry = on_a_circle(70);
  path_.odometry = &odometry;
  const auto segments = cut_segments(path_);
  ASSERT_EQ(segments.size(), 2U);
  EXPECT_EQ(segments[0].chain, segments[1].chain);
  Pose X_WB = path_.instants[0].X_WB;
  double moved_s = 0;
  const auto follow = [&](const SegmentStep& step) {
    EXPECT_LE(step.dt_s, 0.5 + 1e-9) << "from pose to pose";
    moved_s += step.dt_s;
    X_WB = X_WB * Pose{exp_so3(step.dt_s * step.input.w_B), step.dt_s * *step.input.v_B};
  };
  for (const MotionSegment& segment : segments)
    for (const MotionSegment::Instance& instance : segment.instances)
      std::for_each(instance.steps.begin(), instance.steps.end(), follow);
  EXPECT_NEAR(moved_s, 60.65, 1e-9);
  const Pose expected =
      path_.instants[0].X_WB * *odometry.motion(path_.instants[0].at, path_.instants.back().at);
  EXPECT_LT((X_WB.p - expected.p).norm(), 1e-9);
  EXPECT_LT(angle_between(X_WB.q, expected.q), 1e-9);
}

TEST_F(SegmentCuttingTest, AnInstantOnItsOwnIsASegmentWithAnEmptyEnd) {
  EXPECT_TRUE(cut_segments(path_).empty()) << "no pose";
  walk(0, 1);
  const auto segments = cut_segments(path_);
  ASSERT_EQ(segments.size(), 1U);
  ASSERT_EQ(segments[0].instances.size(), 2U);
  EXPECT_EQ(segments[0].instances[0].images.size(), 1U);
  EXPECT_TRUE(segments[0].instances[1].images.empty());
}

}  // namespace
}  // namespace fiducap
