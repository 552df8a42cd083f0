#include "streaming/qualisys/frame_encoder.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

namespace fiducap::qualisys {
namespace {

constexpr double kRounding = 1e-7;  // near ±90° the arc sine loses half of the digits

/// As libmotioncapture rebuilds it.
Eigen::Matrix3d rebuilt(const Eigen::Vector3d& deg) {
  const Eigen::Vector3d a = deg * std::numbers::pi / 180.0;
  return (Eigen::AngleAxisd(a.x(), Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(a.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(a.z(), Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

TEST(QualisysEuler, AnglesRebuildEveryRotation) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Quaterniond q =
        Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
            .normalized();
    const Eigen::Matrix3d R = q.toRotationMatrix();
    EXPECT_TRUE(rebuilt(euler_deg(R)).isApprox(R, kRounding));
  }
}

TEST(QualisysEuler, AnglesRebuildTheRotationsWhereTwoAxesFallTogether) {
  for (const double a2 : {90.0, -90.0}) {
    for (const double a1 : {0.0, 30.0, -120.0, 180.0}) {
      for (const double a3 : {0.0, 45.0, -170.0}) {
        const Eigen::Matrix3d R = rebuilt({a1, a2, a3});
        const Eigen::Vector3d found = euler_deg(R);
        EXPECT_TRUE(found.allFinite());
        EXPECT_TRUE(rebuilt(found).isApprox(R, kRounding)) << a1 << ' ' << a2 << ' ' << a3;
      }
    }
  }
}

TEST(QualisysEuler, EachAngleTurnsAboutItsOwnAxis) {
  const Eigen::Vector3d angles(10, -20, 30);
  EXPECT_TRUE(euler_deg(rebuilt(angles)).isApprox(angles, kRounding));
}

}  // namespace
}  // namespace fiducap::qualisys
