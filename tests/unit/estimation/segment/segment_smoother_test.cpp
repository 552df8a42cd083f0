// What a segment determines and what it does not: its absolute position and the room's heading.
#include "estimation/segment/segment_smoother.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "example_tags.hpp"
#include "known_motion.hpp"
#include "segment/example_segment.hpp"

namespace fiducap {
namespace {

using namespace segment_layout;  // NOLINT: the block names are the subject

/// A common shift and turn of begin, end and tags; cameras stand on the body.
Eigen::MatrixXd common_errors(const SegmentFactor& factor) {
  const int cameras = static_cast<int>(factor.cameras.size());
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(factor.H.rows(), 6);
  for (const int at : {kBegin, kEnd}) N.middleRows<6>(at).setIdentity();
  for (std::size_t i = 0; i < factor.tags.size(); ++i)
    N.middleRows<6>(tag(cameras, static_cast<int>(i))).setIdentity();
  return N;
}

/// How much is known of a common error, against how much is known of it when the body is held.
Eigen::VectorXd share_known(const SegmentFactor& factor) {
  const Eigen::MatrixXd N = common_errors(factor);
  Eigen::MatrixXd of_tags = N;
  of_tags.topRows<30>().setZero();
  return (N.transpose() * factor.H * N)
      .diagonal()
      .cwiseAbs()
      .cwiseQuotient((of_tags.transpose() * factor.H * of_tags).diagonal());
}

// So little of what is known of tags may be rounded into knowledge of where the room is.
constexpr double kNothing = 1e-7;

TEST(SegmentSmoother, DeterminesTheVerticalButNotShiftAndHeadingOfTheRoom) {
  for (const int cameras : {1, 2}) {
    const auto factor = ExampleSegment({.cameras = cameras}).condensed();
    ASSERT_TRUE(factor);
    const Eigen::VectorXd share = share_known(*factor);
    for (const int i : {0, 1, 2, 5}) EXPECT_LT(share(i), kNothing) << i;
    for (const int i : {3, 4}) EXPECT_GT(share(i), 1e-4) << "gravity is felt";
  }
}

TEST(SegmentSmoother, DeterminesNoRotationOfTheRoomWithoutImu) {
  for (const double step_s : {0.025, 0.05}) {
    const auto factor = ExampleSegment({.has_imu = false, .step_s = step_s}).condensed();
    ASSERT_TRUE(factor);
    const Eigen::VectorXd share = share_known(*factor);
    for (int i = 0; i < 6; ++i) EXPECT_LT(share(i), kNothing) << "of " << i << ", " << step_s;
  }
}

TEST(SegmentSmoother, IsIndependentOfItsAbsolutePose) {
  constexpr double kRounding = 1e-7;  // of a sigma squared, 200 m away
  for (const bool has_imu : {true, false}) {
    const ExampleSegment example({.has_imu = has_imu, .step_s = has_imu ? 0.005 : 0.025});
    const Pose G{exp_so3(has_imu ? Eigen::Vector3d(0, 0, 2) : Eigen::Vector3d(0.5, -1, 2)),
                 {200, -50, 7}};
    const auto here = example.condensed();
    MotionSegment moved_there = in_other_axes(G, example.segment);
    const auto there = condense(moved_there);
    ASSERT_TRUE(here && there);
    Eigen::MatrixXd turn = Eigen::MatrixXd::Identity(here->H.rows(), here->H.rows());
    const auto turn_at = [&](int at) { turn.block<3, 3>(at, at) = G.rotation(); };
    for (const int at : {kBegin, kEnd})
      for (const int block : {0, 3, 6}) turn_at(at + block);
    for (std::size_t i = 0; i < here->tags.size(); ++i)
      for (const int block : {0, 3}) turn_at(tag(1, static_cast<int>(i)) + block);
    const Eigen::VectorXd units = here->H.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd off =
        units.asDiagonal() * (turn.transpose() * there->H * turn - here->H) * units.asDiagonal();
    EXPECT_LT(off.cwiseAbs().maxCoeff(), kRounding);
    EXPECT_NEAR(there->cost, here->cost, 1e-6);
    EXPECT_LT((there->end.X_WB.p - G.q * here->end.X_WB.p).norm(), 1e-12);
  }
}

TEST(SegmentSmoother, FindsThePathBetweenFromAnyStart) {
  const ExampleSegment example({});
  MotionSegment segment = example.segment;
  Vector15d off = Vector15d::Zero();
  off.head<9>() << 0.05, -0.04, 0.03, 0.02, 0.03, -0.02, 0.1, -0.1, 0.05;
  for (std::size_t k = 1; k + 1 < segment.instances.size(); ++k)
    segment.instances[k].body = moved(segment.instances[k].body, Vector15d(k % 2 ? off : -off));
  const auto factor = condense(segment);
  ASSERT_TRUE(factor);
  EXPECT_NEAR(factor->cost, 0, 1e-6);
  for (std::size_t k = 0; k < segment.instances.size(); ++k) {
    const BodyMoment& found = segment.instances[k].body;
    const BodyMoment& truth = example.segment.instances[k].body;
    EXPECT_LT((found.X_WB.p - truth.X_WB.p).norm(), 1e-7) << k;
    EXPECT_LT(angle_between(found.X_WB.q, truth.X_WB.q), 1e-7) << k;
    EXPECT_LT((found.v_WB - truth.v_WB).norm(), 1e-5) << k;
  }
}

TEST(SegmentSmoother, ReturnsHowThePathBetweenFollowsTheEnds) {
  constexpr double kStep = 1e-4;
  constexpr double kNotLinear = 1e-6;
  const ExampleSegment example({});
  MotionSegment segment = example.segment;
  const auto path = path_between(segment);
  ASSERT_EQ(path.size() + 2, segment.instances.size());
  for (const int column : {kBegin, kBegin + 5, kEnd + 1, kEnd + 4}) {
    MotionSegment other = segment;
    // Errors are about where the segment begins, which itself may move.
    const Pose origin{Eigen::Quaterniond::Identity(), segment.begin().X_WB.p};
    Vector15d off = Vector15d::Zero();
    off(column % 15) = kStep;
    BodyMoment& end = column < kEnd ? other.instances.front().body : other.instances.back().body;
    end = in_other_axes(origin, moved(in_other_axes(origin.inverse(), end), off));
    ASSERT_FALSE(path_between(other).empty());
    for (std::size_t k = 0; k < path.size(); ++k) {
      const Vector15d error =
          error_between(in_other_axes(origin.inverse(), segment.instances[k + 1].body),
                        in_other_axes(origin.inverse(), other.instances[k + 1].body));
      EXPECT_LT((error - kStep * path[k].by_rest.col(column)).head<6>().norm(), kNotLinear)
          << column << " " << k;
    }
  }
}

TEST(SegmentSmoother, ReturnsHowThePathBetweenFollowsGravity) {
  constexpr double kStep_m_s2 = 1e-3;
  constexpr double kNotLinear = 1e-6;
  MotionSegment segment = ExampleSegment({}).segment;
  const auto path = path_between(segment);
  MotionSegment other = segment;
  other.gravity_offset_m_s2 += kStep_m_s2;
  ASSERT_FALSE(path_between(other).empty());
  for (std::size_t k = 0; k < path.size(); ++k) {
    const Vector15d error =
        error_between(segment.instances[k + 1].body, other.instances[k + 1].body);
    const auto column = path[k].by_rest.rightCols<1>();
    EXPECT_GT(column.norm(), 0);
    EXPECT_LT((error - kStep_m_s2 * column).head<6>().norm(), kNotLinear) << k;
  }
}

TEST(SegmentSmoother, HasTheSmallestSigmaNearTheEnds) {
  MotionSegment segment = ExampleSegment({}).segment;
  const auto path = path_between(segment);
  ASSERT_GT(path.size(), 4U);
  const auto place = [](const PathPoint& point) {
    return point.given.topLeftCorner<3, 3>().trace();
  };
  EXPECT_LT(place(path.front()), place(path[path.size() / 2]));
  EXPECT_LT(place(path.back()), place(path[path.size() / 2]));
}

TEST(SegmentSmoother, DoesNotMoveTheEnds) {
  const ExampleSegment example({});
  Vector15d off = Vector15d::Zero();
  off(0) = 0.1;
  MotionSegment segment = example.segment;
  segment.instances.back().body = moved(segment.instances.back().body, off);
  const MotionSegment before = segment;
  const auto factor = condense(segment);
  ASSERT_TRUE(factor);
  EXPECT_GT(factor->cost, 100) << "it does not fit";
  EXPECT_LT((segment.begin().X_WB.p - before.begin().X_WB.p).norm(), 1e-12);
  EXPECT_LT((segment.end().X_WB.p - before.end().X_WB.p).norm(), 1e-12);
}

TEST(SegmentSmoother, FollowsATrueMotionWithReadingsTaken200TimesASecond) {
  // Between readings a body does not keep its rate: what that makes of a path is far below noise.
  constexpr double kFarBelowNoise = 0.05;
  ExampleSegment example({});
  const Pose shift{Eigen::Quaterniond::Identity(), -Motion::p(0)};
  MotionSegment& segment = example.segment;
  for (MotionSegment::Instance& instance : segment.instances) {
    const double t = to_seconds(instance.body.at - at_s(0));
    instance.body.X_WB = shift * Pose{Motion::q(t), Motion::p(t)};
    instance.body.v_WB = Motion::v(t);
    for (SegmentImage& image : instance.images) {
      const Pose X_WV = instance.body.X_WB * segment.cameras[0].X_BV;
      for (SegmentSighting& sighting : image.tags) {
        const auto known = std::find_if(segment.tags.begin(), segment.tags.end(), [&](auto& tag) {
          return tag.tag_id == sighting.seen.tag_id;
        });
        sighting.seen =
            example_observation(known->tag_id, known->edge_m, X_WV.inverse() * known->X_WT,
                                segment.sensors->cameras[0].model);
      }
    }
  }
  const auto factor = example.condensed();
  ASSERT_TRUE(factor);
  EXPECT_LT(factor->cost, kFarBelowNoise);
  const Eigen::VectorXd units = factor->H.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT(factor->g.cwiseProduct(units).cwiseAbs().maxCoeff(), kFarBelowNoise);
}

/// Influence of one corner that is off by the pixels in the middle of the segment.
std::pair<double, SegmentFactor> pull_of(double off_px) {
  ExampleSegment example({});
  SegmentSighting& sighting = example.segment.instances[5].images.front().tags.front();
  sighting.seen.corners_px[1].x() += off_px;
  sighting.seen.raw_px[1].x() += off_px;
  SegmentFactor factor = *example.condensed();
  const Eigen::VectorXd units = factor.H.diagonal().cwiseSqrt().cwiseInverse();
  return {factor.g.cwiseProduct(units).norm(), factor};
}

TEST(SegmentSmoother, AWrongSightingHasLittleInfluence) {
  const auto [right, as_noise] = pull_of(0.5);
  const auto [wrong, factor] = pull_of(100);
  EXPECT_EQ(as_noise.outliers, 0);
  EXPECT_EQ(factor.outliers, 1);
  EXPECT_EQ(factor.sightings, as_noise.sightings) << "it is not left out";
  EXPECT_LT(wrong, right) << "a hundred pixels pull less than half a pixel";
  EXPECT_GT(wrong, 0);
  EXPECT_GT(factor.cost, as_noise.cost) << "and still costs more";
}

TEST(SegmentSmoother, GivesNothingWithoutAnEnd) {
  ExampleSegment example({});
  example.segment.instances.resize(1);
  EXPECT_FALSE(example.condensed());
  example.segment.instances.clear();
  EXPECT_FALSE(example.condensed());
}

TEST(SegmentSmoother, GivesNothingWithoutAKnownTag) {
  ExampleSegment example({});
  example.segment.tags.clear();
  EXPECT_FALSE(example.condensed()) << "no tag that is seen has a place";
  ExampleSegment blind({});
  for (MotionSegment::Instance& instance : blind.segment.instances) instance.images.clear();
  EXPECT_FALSE(blind.condensed()) << "nothing is seen";
}

TEST(SegmentSmoother, GivesNothingForNonFiniteNumbers) {
  ExampleSegment example({});
  example.segment.instances[3].steps.front().input.f_B.x() = NAN;
  EXPECT_FALSE(example.condensed());
}

}  // namespace
}  // namespace fiducap
