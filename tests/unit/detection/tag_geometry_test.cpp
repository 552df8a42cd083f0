#include "detection/tag_geometry.hpp"

#include <gtest/gtest.h>

#include <random>

#include <Eigen/LU>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using Corners = TagCorners;

/// Intersection of the lines through a and b, and c and d.
Eigen::Vector2d intersection_of(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
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
    out.segment<2>(2 * i) = intersection_of(before[0], before[1], after[0], after[1]);
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

CameraModel camera() {
  CameraModel c;
  c.width = 752;
  c.height = 480;
  c.fu = 460;
  c.fv = 455;
  c.cu = 376;
  c.cv = 240;
  return c;
}

TagObservation seen_from(const Pose& X_VT, double edge_m, double noise_px = 0, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss(0, noise_px > 0 ? noise_px : 1);
  TagObservation tag;
  tag.edge_m = edge_m;
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<std::size_t>(i);
    tag.corners_px[k] = camera().pinhole(X_VT * tag_corner(i, edge_m));
    if (noise_px > 0) {
      const double du = gauss(random);
      const double dv = gauss(random);
      tag.corners_px[k] += Eigen::Vector2d(du, dv);
    }
    tag.ideal_from_raw[k].setIdentity();
  }
  return tag;
}

// A tag facing the camera: its z axis points back to the camera, its y axis up in the image.
const Eigen::Quaterniond kFacing = exp_so3({M_PI, 0, 0});

TEST(TagCorner, StartsLowerLeftAndRunsCounterClockwise) {
  EXPECT_EQ(tag_corner(0, 2.0), Eigen::Vector3d(-1, -1, 0));
  EXPECT_EQ(tag_corner(1, 2.0), Eigen::Vector3d(1, -1, 0));
  EXPECT_EQ(tag_corner(2, 2.0), Eigen::Vector3d(1, 1, 0));
  EXPECT_EQ(tag_corner(3, 2.0), Eigen::Vector3d(-1, 1, 0));
}

TEST(TagPose, FindsTheTruePoseOfExactCorners) {
  const std::vector<Eigen::Vector3d> tilts{{0.3, 0.1, 0}, {-0.5, 0.4, 0.8}, {0.2, -0.9, -2.0}};
  for (const auto& tilt : tilts) {
    const Pose truth{exp_so3(tilt) * kFacing, {0.3, -0.2, 1.5}};
    const auto poses = solve_tag_pose(seen_from(truth, 0.2), camera());
    EXPECT_LT((poses[0].X_VT.p - truth.p).norm(), 1e-6);
    EXPECT_LT(angle_between(poses[0].X_VT.q, truth.q), 1e-6);
    EXPECT_LT(poses[0].rms_px, 1e-6);
    EXPECT_GE(poses[1].rms_px, poses[0].rms_px);
  }
}

TEST(TagPose, OneOfBothBranchesIsTheTrueOneWhenFarAndNoisy) {
  int better_is_true = 0;
  constexpr int kRuns = 60;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    const Pose truth{exp_so3({0.35, 0.2, 0}) * kFacing, {0.1, 0.1, 5.0}};
    const auto poses = solve_tag_pose(seen_from(truth, 0.2, 0.4, seed), camera());
    const double first = angle_between(poses[0].X_VT.q, truth.q);
    const double second = angle_between(poses[1].X_VT.q, truth.q);
    EXPECT_LT(std::min(first, second), 0.45) << "seed " << seed;
    better_is_true += first <= second ? 1 : 0;
  }
  // The point of keeping both: at this distance the better one is often the wrong one.
  EXPECT_GT(better_is_true, kRuns / 3);
  EXPECT_LT(better_is_true, kRuns);
}

TEST(CornerResidual, JacobianMatchesDifferences) {
  const Pose X_VT{exp_so3({0.4, -0.3, 0.2}) * kFacing, {0.3, -0.2, 1.5}};
  TagObservation tag = seen_from(X_VT, 0.2);
  for (auto& J : tag.ideal_from_raw) J << 1.2, 0.1, -0.05, 0.9;
  const CornerResidual r = corner_residual(tag, X_VT, camera());
  expect_jacobian(-r.H, [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    return corner_residual(tag, {exp_so3(d.tail<3>()) * X_VT.q, X_VT.p + d.head<3>()}, camera()).y;
  });
}

class CornerResidualBent : public testing::TestWithParam<Distortion> {};

TEST_P(CornerResidualBent, KnowsALensByItsFirstCoefficient) {
  CameraModel configured = camera();
  configured.distortion = GetParam();
  if (GetParam() != Distortion::kNone) configured.coefficients = {-0.2, 0.03, 0, 0, 0};
  constexpr double kMore = -0.07;
  const CameraModel bent = LensOffset{.k1 = kMore}.applied_to(configured);
  const Pose X_VT{exp_so3({0.4, -0.3, 0.2}) * kFacing, {0.4, -0.3, 1.2}};
  TagObservation tag = seen_from(X_VT, 0.2);
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<std::size_t>(i);
    tag.raw_px[k] = *bent.project(X_VT * tag_corner(i, tag.edge_m));
    // Linearised at the corner's projection by the configured lens, which isolates the effect of
    // k1.
    const auto pixel = undistort(configured, *configured.project(X_VT * tag_corner(i, tag.edge_m)));
    tag.ideal_from_raw[k] = pixel->ideal_from_raw;
    tag.corners_px[k] =
        pixel->px + pixel->ideal_from_raw *
                        (tag.raw_px[k] - *configured.project(X_VT * tag_corner(i, tag.edge_m)));
  }
  const CornerResidual residual = corner_residual(tag, X_VT, configured);
  EXPECT_GT(residual.rms_px(), 0.5);
  EXPECT_LT((residual.y - kMore * residual.H_k1).norm(), 1e-6 * residual.y.norm());
  const CornerResidual known = corner_residual(tag, X_VT, configured, 1.0, kMore);
  EXPECT_LT(known.rms_px(), 1e-6);
  expect_jacobian(-known.H, [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
    const Pose X{exp_so3(d.tail<3>()) * X_VT.q, X_VT.p + d.head<3>()};
    return corner_residual(tag, X, configured, 1.0, kMore).y;
  });
}

INSTANTIATE_TEST_SUITE_P(Lenses, CornerResidualBent,
                         testing::Values(Distortion::kNone, Distortion::kRadialTangential,
                                         Distortion::kEquidistant));

TEST(LensOffset, GivesALensWithoutDistortionNothingButItsOwn) {
  CameraModel none = camera();
  none.coefficients = {-0.3, 0.1, 0, 0, 0};  // not used while there is no distortion
  const CameraModel bent = LensOffset{.k1 = -0.07}.applied_to(none);
  EXPECT_EQ(bent.distortion, Distortion::kRadialTangential);
  EXPECT_EQ(bent.coefficients, (std::array<double, 5>{-0.07, 0, 0, 0, 0}));
  EXPECT_EQ(LensOffset{.focal = 0.1}.applied_to(none).distortion, Distortion::kNone);
}

TEST(CornerResidual, ReportsATagBehindTheCamera) {
  const TagObservation tag = seen_from({kFacing, {0, 0, 1}}, 0.2);
  EXPECT_FALSE(corner_residual(tag, {kFacing, {0, 0, -1}}, camera()).in_front);
}

}  // namespace
}  // namespace fiducap
