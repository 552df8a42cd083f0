// A segment does not determine its absolute position and the room's heading; the gradient and the
// Hessian of a condensed segment against differences.
#include "estimation/segment/segment_smoother.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/pose.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "example_tags.hpp"
#include "known_motion.hpp"
#include "segment/example_segment.hpp"
#include "support/jacobian_check.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

using namespace segment_layout;  // NOLINT: the block names are the subject

/// A common shift and rotation of begin, end and tags.
Eigen::MatrixXd common_errors(const SegmentFactor& factor) {
  const int cameras = static_cast<int>(factor.cameras.size());
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(factor.H.rows(), 6);
  for (const int at : {kBegin, kEnd}) N.middleRows<6>(at).setIdentity();
  for (std::size_t i = 0; i < factor.tags.size(); ++i)
    N.middleRows<6>(tag(cameras, static_cast<int>(i))).setIdentity();
  return N;
}

/// Sigma of every number if all others were known: the natural unit of differences.
Eigen::VectorXd units_of(const SegmentFactor& factor) {
  return factor.H.diagonal().cwiseSqrt().cwiseInverse();
}

double distance(const Pose& a, const Pose& b) { return (a.p - b.p).norm(); }

/// Information about a common error, relative to that with a fixed body.
Eigen::VectorXd share_known(const ExampleSegment::Setup& setup) {
  const auto factor = ExampleSegment(setup).condensed();
  if (!factor) return Eigen::VectorXd::Constant(6, NAN);
  Eigen::MatrixXd N = common_errors(*factor).transpose();
  const Eigen::VectorXd of_all = propagated(N, factor->H).diagonal().cwiseAbs();
  N.leftCols<30>().setZero();
  return of_all.cwiseQuotient(propagated(N, factor->H).diagonal());
}

// Of the information about tags, by rounding.
constexpr double kNothing = 1e-7;

TEST(SegmentSmoother, DeterminesTheVerticalButNotShiftAndHeadingOfTheRoom) {
  for (const int cameras : {1, 2}) {
    const Eigen::VectorXd share = share_known({.cameras = cameras});
    for (const int i : {0, 1, 2, 5}) EXPECT_LT(share(i), kNothing) << i;
    for (const int i : {3, 4}) EXPECT_GT(share(i), 1e-4) << "gravity is measured";
  }
}

TEST(SegmentSmoother, DeterminesNoRotationOfTheRoomWithoutImu) {
  for (const double step_s : {0.025, 0.05}) {
    const Eigen::VectorXd share = share_known({.has_imu = false, .step_s = step_s});
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
    const Eigen::VectorXd units = units_of(*here);
    const Eigen::MatrixXd off = propagated(turn.transpose(), there->H) - here->H;
    EXPECT_LT((units.asDiagonal() * off * units.asDiagonal()).cwiseAbs().maxCoeff(), kRounding);
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
  const auto factor = value_of(condense(segment));
  EXPECT_NEAR(factor.cost, 0, 1e-6);
  for (std::size_t k = 0; k < segment.instances.size(); ++k) {
    const BodyMoment& found = segment.instances[k].body;
    const BodyMoment& truth = example.segment.instances[k].body;
    EXPECT_LT(distance(found.X_WB, truth.X_WB), 1e-7) << k;
    EXPECT_LT(angle_between(found.X_WB.q, truth.X_WB.q), 1e-7) << k;
    EXPECT_LT((found.v_WB - truth.v_WB).norm(), 1e-5) << k;
  }
}

TEST(SegmentSmoother, ReturnsHowThePathBetweenFollowsTheEndsAndGravity) {
  constexpr double kNotLinear = 1e-6;
  MotionSegment segment = ExampleSegment({}).segment;
  const auto path = path_between(segment);
  ASSERT_EQ(path.size() + 2, segment.instances.size());
  // Errors are about where the segment begins, which itself may move.
  const Pose origin{Eigen::Quaterniond::Identity(), segment.begin().X_WB.p};
  const auto expect_follows = [&](MotionSegment other, Eigen::Index column, double step) {
    ASSERT_FALSE(path_between(other).empty());
    for (std::size_t k = 0; k < path.size(); ++k) {
      const Vector15d error =
          error_between(in_other_axes(origin.inverse(), segment.instances[k + 1].body),
                        in_other_axes(origin.inverse(), other.instances[k + 1].body));
      EXPECT_LT((error - step * path[k].by_rest.col(column)).head<6>().norm(), kNotLinear)
          << column << " " << k;
      EXPECT_GT(path[k].by_rest.col(column).norm(), 0);
    }
  };
  for (const int column : {kBegin, kBegin + 5, kEnd + 1, kEnd + 4}) {
    constexpr double kStep = 1e-4;
    MotionSegment other = segment;
    Vector15d off = Vector15d::Zero();
    off(column % 15) = kStep;
    BodyMoment& end = column < kEnd ? other.instances.front().body : other.instances.back().body;
    end = in_other_axes(origin, moved(in_other_axes(origin.inverse(), end), off));
    expect_follows(other, column, kStep);
  }
  constexpr double kStep_m_s2 = 1e-3;
  MotionSegment heavier = segment;
  heavier.gravity_offset_m_s2 += kStep_m_s2;
  expect_follows(heavier, path.front().by_rest.cols() - 1, kStep_m_s2);
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
  const auto factor = value_of(condense(segment));
  EXPECT_GT(factor.cost, 100) << "it does not fit";
  EXPECT_LT((segment.begin().X_WB.p - before.begin().X_WB.p).norm(), 1e-12);
  EXPECT_LT((segment.end().X_WB.p - before.end().X_WB.p).norm(), 1e-12);
}

// Between readings a body does not keep its rate: the effect on the path is far below noise.
TEST(SegmentSmoother, FollowsATrueMotionWithReadingsAt200Hz) {
  constexpr double kFarBelowNoise = 0.05;
  ExampleSegment example({});
  const Pose shift{Eigen::Quaterniond::Identity(), -Motion::p(0)};
  MotionSegment& segment = example.segment;
  for (MotionSegment::Instance& instance : segment.instances) {
    const double t = to_seconds(instance.body.at - at_s(0));
    instance.body.X_WB = shift * Pose{Motion::q(t), Motion::p(t)};
    instance.body.v_WB = Motion::v(t);
    const Pose X_VW = (instance.body.X_WB * segment.cameras[0].X_BV).inverse();
    for (SegmentImage& image : instance.images) {
      for (SegmentSighting& sighting : image.tags) {
        const auto known = std::ranges::find(segment.tags, sighting.seen.tag_id, &KnownTag::tag_id);
        sighting.seen = example_observation(known->tag_id, known->edge_m, X_VW * known->X_WT,
                                            segment.sensors->cameras[0].model);
      }
    }
  }
  const auto factor = value_of(example.condensed());
  EXPECT_LT(factor.cost, kFarBelowNoise);
  EXPECT_LT(factor.g.cwiseProduct(units_of(factor)).cwiseAbs().maxCoeff(), kFarBelowNoise);
}

/// Influence of one corner that is off by the pixels in the middle of the segment.
std::pair<double, SegmentFactor> pull_of(double off_px) {
  ExampleSegment example({});
  SegmentSighting& sighting = example.segment.instances[5].images.front().tags.front();
  sighting.seen.corners_px[1].x() += off_px;
  sighting.seen.raw_px[1].x() += off_px;
  const SegmentFactor factor = *example.condensed();
  return {factor.g.cwiseProduct(units_of(factor)).norm(), factor};
}

TEST(SegmentSmoother, AWrongSightingHasLittleInfluence) {
  const auto [right, as_noise] = pull_of(0.5);
  const auto [wrong, factor] = pull_of(100);
  EXPECT_EQ(as_noise.outliers, 0);
  EXPECT_EQ(factor.outliers, 1);
  EXPECT_EQ(factor.sightings, as_noise.sightings) << "it is not left out";
  EXPECT_LT(wrong, right);
  EXPECT_GT(wrong, 0);
  EXPECT_GT(factor.cost, as_noise.cost) << "but it costs more";
}

TEST(SegmentSmoother, GivesNothingForAnInvalidSegment) {
  struct Case {
    const char* what;
    void (*change)(MotionSegment&);
  };
  const Case cases[] = {
      {"no end", [](MotionSegment& s) { s.instances.resize(1); }},
      {"empty", [](MotionSegment& s) { s.instances.clear(); }},
      {"no known tag", [](MotionSegment& s) { s.tags.clear(); }},
      {"no image",
       [](MotionSegment& s) {
         for (auto& instance : s.instances) instance.images.clear();
       }},
      {"not finite", [](MotionSegment& s) { s.instances[3].steps.front().input.f_B.x() = NAN; }}};
  for (const auto& [what, change] : cases) {
    ExampleSegment example({});
    change(example.segment);
    EXPECT_FALSE(example.condensed()) << what;
  }
}

struct DerivativeCase {
  const char* name;
  ExampleSegment::Setup setup;
  /// Of the gradient's largest number: noise and Jacobians are taken as constant.
  double tolerance{0.01};
};

void PrintTo(const DerivativeCase& value, std::ostream* out) { *out << value.name; }

const DerivativeCase kCases[] = {
    {"imu", {}},
    {"off_in_everything",
     {.shift_s = 0.004,
      .readout_s = 0.016,
      .lens = {0.01, {2.0, -1.0}, -0.06},
      .scale = 0.05,
      .is_even = false,
      .gravity_more_m_s2 = 0.05}},
    {"jitter", {.jitter_s = 0.002}, 0.03},  // … and the division of a stamp's error
    {"two_cameras", {.cameras = 2}},
    {"no_imu", {.has_imu = false, .step_s = 0.025}},
};

class SegmentDerivatives : public testing::TestWithParam<DerivativeCase> {
 protected:
  [[nodiscard]] std::optional<SegmentFactor> at(const MotionSegment& from,
                                                const Eigen::VectorXd& error) const {
    MotionSegment segment = moved(from, error);
    return condense(segment);
  }

  ExampleSegment example_{GetParam().setup};
};

TEST_P(SegmentDerivatives, AreZeroWhereEverythingFits) {
  const auto factor = value_of(example_.condensed());
  EXPECT_NEAR(factor.cost, 0, 1e-6);
  EXPECT_LT(factor.g.cwiseProduct(units_of(factor)).cwiseAbs().maxCoeff(), 1e-3) << "of a sigma";
  EXPECT_GT(factor.sightings, 12);
  EXPECT_EQ(factor.numbers, 8 * factor.sightings);
  EXPECT_EQ(factor.outliers, 0);
}

TEST_P(SegmentDerivatives, OfSecondOrderMatchDifferencesOfTheGradient) {
  constexpr double kStep = 0.1;        // of a sigma
  constexpr double kTolerance = 2e-3;  // the loss bends, and steps are not linear
  const auto here = value_of(example_.condensed());
  const Eigen::VectorXd units = units_of(here);
  for (Eigen::Index i = 0; i < units.size(); ++i) {
    const Eigen::VectorXd step = kStep * units(i) * Eigen::VectorXd::Unit(units.size(), i);
    const auto after = at(example_.segment, step);
    const auto before = at(example_.segment, -step);
    ASSERT_TRUE(after && before);
    const Eigen::VectorXd column = (after->g - before->g) / (2 * kStep * units(i));
    const Eigen::VectorXd off = units(i) * units.cwiseProduct(column - here.H.col(i));
    EXPECT_LT(off.cwiseAbs().maxCoeff(), kTolerance) << "number " << i;
    // … and of the cost itself.
    const double curvature = (after->cost + before->cost - 2 * here.cost) / (kStep * kStep);
    EXPECT_NEAR(curvature, 1, 0.01) << "number " << i;
  }
}

TEST_P(SegmentDerivatives, OfFirstOrderMatchDifferencesOfTheCost) {
  constexpr double kStep = 0.1;
  const auto truth = value_of(example_.condensed());
  std::mt19937_64 random(4);
  // Below the bend of the loss, which is reweighted, not derived.
  std::normal_distribution<double> gauss(0, 0.5);
  const Eigen::VectorXd off =
      units_of(truth).unaryExpr([&](double u) { return u * gauss(random); });
  MotionSegment segment = moved(example_.segment, off);
  // Errors are about the place where it begins.
  segment = in_other_axes({Eigen::Quaterniond::Identity(), -segment.begin().X_WB.p}, segment);
  const auto here = value_of(at(segment, Eigen::VectorXd::Zero(off.size())));
  const Eigen::VectorXd units = units_of(here);
  const Eigen::VectorXd gradient = here.g.cwiseProduct(units);
  const double scale = gradient.cwiseAbs().maxCoeff();
  EXPECT_GT(scale, 0.5) << "enough to compare";
  for (Eigen::Index i = 0; i < units.size(); ++i) {
    const Eigen::VectorXd step = kStep * units(i) * Eigen::VectorXd::Unit(units.size(), i);
    const auto after = at(segment, step);
    const auto before = at(segment, -step);
    ASSERT_TRUE(after && before);
    EXPECT_NEAR((after->cost - before->cost) / (2 * kStep), gradient(i),
                GetParam().tolerance * scale)
        << "number " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(OfSegments, SegmentDerivatives, testing::ValuesIn(kCases),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace fiducap
