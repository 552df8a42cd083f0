#include "streaming/conventions/protocol_conventions.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "base/pose.hpp"

namespace fiducap {
namespace {

constexpr double kRounding = 1e-12;

TEST(ProtocolConventions, EachProtocolStandsOnceAndIsFound) {
  std::set<std::string_view> names;
  for (const auto& one : kProtocolConventions) {
    EXPECT_TRUE(names.insert(one.protocol).second) << one.protocol;
    EXPECT_EQ(&conventions_of(one.protocol), &one);
    EXPECT_NE(one.when_invalid, WhenInvalid::kHold)
        << "never a stale pose as live by default: " << one.protocol;
  }
}

/// A point fixed in the world and one fixed in the body stay the same points for every
/// protocol's axes and units.
TEST(ProtocolConventions, EveryProtocolKeepsTheGeometry) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  for (const auto& one : kProtocolConventions) {
    const AxesChange change(one.axes);
    for (int i = 0; i < 50; ++i) {
      const Pose X_WP{exp_so3(vector()), vector()};
      const Eigen::Vector3d p_P = vector();
      const Pose X_CP = change.pose(X_WP);
      const Eigen::Vector3d p_as_the_client_sees_it =
          one.axes.scope == AxesScope::kWorldAndBody ? change.length(p_P)
                                                     : Eigen::Vector3d(one.axes.units_per_m * p_P);
      EXPECT_LT((X_CP * p_as_the_client_sees_it - change.length(X_WP * p_P)).norm(),
                1e3 * kRounding * one.axes.units_per_m)
          << one.protocol;
      EXPECT_NEAR(change.length(p_P).norm(), one.axes.units_per_m * p_P.norm(), 1e-9)
          << one.protocol;
    }
  }
}

}  // namespace
}  // namespace fiducap
