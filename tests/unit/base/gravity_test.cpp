#include "base/gravity.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

// Digits of the published values.
constexpr double kRounded_m_s2 = 1e-5;
// Local anomalies of gravity, and approximate heights.
constexpr double kMeasured_m_s2 = 1e-3;

TEST(NormalGravity, IsThatOfTheReferenceEllipsoid) {
  EXPECT_NEAR(normal_gravity(0, 0), 9.78033, kRounded_m_s2);
  EXPECT_NEAR(normal_gravity(45, 0), 9.80620, kRounded_m_s2);
  EXPECT_NEAR(normal_gravity(90, 0), 9.83219, kRounded_m_s2);
  EXPECT_NEAR(normal_gravity(-45, 0), normal_gravity(45, 0), 1e-15);
}

TEST(NormalGravity, FallsWithHeightAsInFreeAir) {
  EXPECT_NEAR(normal_gravity(45, 1000) - normal_gravity(45, 0), -3.085e-3, kRounded_m_s2);
  EXPECT_NEAR(normal_gravity(19.4, 2240), 9.779, kMeasured_m_s2) << "Mexico City";
  EXPECT_NEAR(normal_gravity(60.2, 20), 9.819, kMeasured_m_s2) << "Helsinki";
}

}  // namespace
}  // namespace fiducap
