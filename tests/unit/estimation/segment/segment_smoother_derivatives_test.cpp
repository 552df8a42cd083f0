// Gradient and Hessian of a condensed segment against differences of what it makes of moved
// boundary values, the path between free to follow.
#include <gtest/gtest.h>

#include <random>

#include "segment/example_segment.hpp"

namespace fiducap {
namespace {

struct Case {
  const char* name;
  ExampleSegment::Setup setup;
  /// Of the gradient's largest number: how noise and Jacobians change with the place is not
  /// derived.
  double tolerance{0.01};
};

void PrintTo(const Case& value, std::ostream* out) { *out << value.name; }

const Case kCases[] = {
    {"imu", {}},
    {"off_in_everything",
     {.shift_s = 0.004,
      .readout_s = 0.016,
      .lens = {0.01, {2.0, -1.0}, -0.06},
      .scale = 0.05,
      .is_even = false,
      .gravity_more_m_s2 = 0.05}},
    {"jitter", {.jitter_s = 0.002}, 0.03},  // … how a stamp's error is divided, neither
    {"two_cameras", {.cameras = 2}},
    {"no_imu", {.has_imu = false, .step_s = 0.025}},
};

/// Every number's own 1-sigma, were all others known: the natural unit of differences.
Eigen::VectorXd units_of(const SegmentFactor& factor) {
  return factor.H.diagonal().cwiseSqrt().cwiseInverse();
}

class SegmentDerivatives : public testing::TestWithParam<Case> {
 protected:
  [[nodiscard]] std::optional<SegmentFactor> at(const MotionSegment& from,
                                                const Eigen::VectorXd& error) const {
    MotionSegment segment = moved(from, error);
    return condense(segment);
  }

  ExampleSegment example_{GetParam().setup};
};

TEST_P(SegmentDerivatives, AreZeroWhereEverythingFits) {
  const auto factor = example_.condensed();
  ASSERT_TRUE(factor);
  EXPECT_NEAR(factor->cost, 0, 1e-6);
  EXPECT_LT(factor->g.cwiseProduct(units_of(*factor)).cwiseAbs().maxCoeff(), 1e-3) << "of a sigma";
  EXPECT_GT(factor->sightings, 12);
  EXPECT_EQ(factor->numbers, 8 * factor->sightings);
  EXPECT_EQ(factor->outliers, 0);
}

TEST_P(SegmentDerivatives, OfSecondOrderMatchDifferencesOfTheGradient) {
  constexpr double kStep = 0.1;        // of a sigma
  constexpr double kTolerance = 2e-3;  // where the loss bends, and steps are not linear
  const auto here = example_.condensed();
  ASSERT_TRUE(here);
  const Eigen::VectorXd units = units_of(*here);
  for (Eigen::Index i = 0; i < units.size(); ++i) {
    const Eigen::VectorXd step = kStep * units(i) * Eigen::VectorXd::Unit(units.size(), i);
    const auto after = at(example_.segment, step);
    const auto before = at(example_.segment, -step);
    ASSERT_TRUE(after && before);
    const Eigen::VectorXd column = (after->g - before->g) / (2 * kStep * units(i));
    const Eigen::VectorXd off = units(i) * units.cwiseProduct(column - here->H.col(i));
    EXPECT_LT(off.cwiseAbs().maxCoeff(), kTolerance) << "number " << i;
    // … and of the cost itself.
    const double curvature = (after->cost + before->cost - 2 * here->cost) / (kStep * kStep);
    EXPECT_NEAR(curvature, 1, 0.01) << "number " << i;
  }
}

TEST_P(SegmentDerivatives, OfFirstOrderMatchDifferencesOfTheCost) {
  constexpr double kStep = 0.1;
  const auto truth = example_.condensed();
  ASSERT_TRUE(truth);
  std::mt19937_64 random(4);
  // Little enough that the loss does not bend: it is reweighted, not derived.
  std::normal_distribution<double> gauss(0, 0.5);
  const Eigen::VectorXd off =
      units_of(*truth).unaryExpr([&](double u) { return u * gauss(random); });
  MotionSegment segment = moved(example_.segment, off);
  // Errors are about the place where it begins.
  segment = in_other_axes({Eigen::Quaterniond::Identity(), -segment.begin().X_WB.p}, segment);
  const auto here = at(segment, Eigen::VectorXd::Zero(off.size()));
  ASSERT_TRUE(here);
  const Eigen::VectorXd units = units_of(*here);
  const Eigen::VectorXd gradient = here->g.cwiseProduct(units);
  const double scale = gradient.cwiseAbs().maxCoeff();
  EXPECT_GT(scale, 0.5) << "else nothing is compared";
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
