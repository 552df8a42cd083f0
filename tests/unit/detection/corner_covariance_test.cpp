#include "detection/corner_covariance.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

namespace fiducap {
namespace {

using Corners = std::array<Eigen::Vector2d, 4>;

/// Where the line through a and b meets the one through c and d.
Eigen::Vector2d meeting(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                        const Eigen::Vector2d& c, const Eigen::Vector2d& d) {
  Eigen::Matrix2d along;
  along << b - a, c - d;
  return a + (b - a) * (along.inverse() * (c - a)).x();
}

/// The corners when the ends of one side are moved across it.
Vector8d corners_when(const Corners& px, std::size_t side, double at_first, double at_last) {
  std::array<std::array<Eigen::Vector2d, 2>, 4> lines;
  for (std::size_t i = 0; i < 4; ++i) lines[i] = {px[i], px[(i + 1) % 4]};
  const Eigen::Vector2d along = (lines[side][1] - lines[side][0]).normalized();
  const Eigen::Vector2d normal(-along.y(), along.x());
  lines[side][0] += at_first * normal;
  lines[side][1] += at_last * normal;
  Vector8d out;
  for (int i = 0; i < 4; ++i) {
    const auto& before = lines[static_cast<std::size_t>((i + 3) % 4)];
    const auto& after = lines[static_cast<std::size_t>(i)];
    out.segment<2>(2 * i) = meeting(before[0], before[1], after[0], after[1]);
  }
  return out;
}

TEST(CornerCovariance, IsThatOfCornersWhoseSidesAreMoved) {
  constexpr double kStep_px = 1e-4;
  const Corners slanted{{{100, 180}, {171, 150}, {160, 92}, {88, 120}}};
  const std::array<SideSigma, 4> sides{{{0.3, 0.1}, {0.02, 0.05}, {0.25, 0.2}, {0.03, 0.04}}};
  Matrix8d R = Matrix8d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const auto move = [&](double first, double last) -> Vector8d {
      return (corners_when(slanted, i, first * kStep_px, last * kStep_px) -
              corners_when(slanted, i, -first * kStep_px, -last * kStep_px)) /
             (2 * kStep_px);
    };
    const Vector8d shifted = sides[i].shift_px * move(1, 1);
    const Vector8d turned = sides[i].turn_px * move(1, -1);
    R += shifted * shifted.transpose() + turned * turned.transpose();
  }
  const Matrix8d got = corner_covariance(slanted, sides);
  EXPECT_LT((got - R).cwiseAbs().maxCoeff(), 1e-7) << "central differences, px²";
}

TEST(CornerCovariance, OfASquareWithEqualSidesIsTheSameForAllCoordinates) {
  const Corners square{{{10, 70}, {70, 70}, {70, 10}, {10, 10}}};
  std::array<SideSigma, 4> sides;
  sides.fill({0.03, 0.04});
  const Matrix8d R = corner_covariance(square, sides);
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(R(i, i), 0.05 * 0.05, 1e-12);
  // The ends of a side are off against each other when it turns more than it shifts.
  EXPECT_NEAR(R(1, 3), 0.03 * 0.03 - 0.04 * 0.04, 1e-12);
}

TEST(CornerCovariance, IsFiniteWhereTwoSidesAreNearlyOneLine) {
  const Corners flat{{{0, 0}, {50, -1e-9}, {100, 0}, {50, -40}}};
  std::array<SideSigma, 4> sides;
  sides.fill({0.03, 0.04});
  EXPECT_TRUE(corner_covariance(flat, sides).allFinite());
}

}  // namespace
}  // namespace fiducap
