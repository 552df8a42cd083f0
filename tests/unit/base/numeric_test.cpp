#include "base/numeric.hpp"

#include <gtest/gtest.h>

#include "base/gravity.hpp"
#include "base/pose.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

TEST(DurationHistogram, QuantilesAreWithinABin) {
  DurationHistogram histogram;
  EXPECT_EQ(histogram.quantile(0.5), Duration{0});
  for (int us = 1; us <= 1000; ++us) histogram.add(std::chrono::microseconds(10 * us));
  EXPECT_EQ(histogram.count(), 1000u);
  constexpr double kBin = 0.03;
  EXPECT_NEAR(to_seconds(histogram.quantile(0.5)), 5e-3, kBin * 5e-3);
  EXPECT_NEAR(to_seconds(histogram.quantile(0.99)), 9.9e-3, kBin * 9.9e-3);
}

TEST(DurationHistogram, CountsOutliersInItsLastBins) {
  DurationHistogram histogram;
  histogram.add(Duration{-5});
  EXPECT_LT(histogram.quantile(1), std::chrono::microseconds(2));
  histogram.add(std::chrono::hours(100));
  EXPECT_GT(histogram.quantile(1), std::chrono::minutes(20));
}

TEST(Parabola, MinimumIsAtMostOneStepAway) {
  const auto values = [](double x) { return 3 * (x - 0.3) * (x - 0.3) + 2; };
  EXPECT_NEAR(minimum_of_parabola(values(-1), values(0), values(1)), 0.3, 1e-12);
  EXPECT_EQ(minimum_of_parabola(9, 5, 1.1), 1.0);
  EXPECT_EQ(minimum_of_parabola(1, 2, 1), 0.0) << "it has none";
  EXPECT_EQ(minimum_of_parabola(1, 1, 1), 0.0) << "it has none";
}

TEST(NormalGravity, IsThatOfTheReferenceEllipsoid) {
  constexpr double kRounded_m_s2 = 1e-5;   // digits of the published values
  constexpr double kMeasured_m_s2 = 1e-3;  // local anomalies, and approximate heights
  EXPECT_NEAR(normal_gravity(0, 0), 9.78033, kRounded_m_s2);
  EXPECT_NEAR(normal_gravity(45, 0), 9.80620, kRounded_m_s2);
  EXPECT_NEAR(normal_gravity(90, 0), 9.83219, kRounded_m_s2);
  EXPECT_NEAR(normal_gravity(-45, 0), normal_gravity(45, 0), 1e-15);
  EXPECT_NEAR(normal_gravity(45, 1000) - normal_gravity(45, 0), -3.085e-3, kRounded_m_s2);
  EXPECT_NEAR(normal_gravity(19.4, 2240), 9.779, kMeasured_m_s2) << "Mexico City";
  EXPECT_NEAR(normal_gravity(60.2, 20), 9.819, kMeasured_m_s2) << "Helsinki";
}

constexpr double kRounding = 1e-12;

TEST(So3, LogAndJacobianMatchExp) {
  const std::vector<Eigen::Vector3d> rotations{
      {0, 0, 0}, {1e-8, -2e-8, 0}, {1e-4, 0, 1e-4}, {0.3, -0.2, 0.9}, {2.0, 1.0, -2.0}};
  for (const Eigen::Vector3d& r : rotations) {
    EXPECT_LT((log_so3(exp_so3(r)) - r).norm(), kRounding) << r.transpose();
    expect_jacobian(left_jacobian_so3(r), [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      return log_so3(exp_so3(r + d) * exp_so3(r).conjugate());
    });
  }
}

TEST(So3, ExpRotatesByTheAngleAboutTheAxis) {
  const Eigen::Vector3d rotated = exp_so3({0, 0, M_PI / 2}) * Eigen::Vector3d::UnitX();
  EXPECT_LT((rotated - Eigen::Vector3d::UnitY()).norm(), kRounding);
}

}  // namespace
}  // namespace fiducap
