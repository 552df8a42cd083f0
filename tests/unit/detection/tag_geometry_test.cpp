#include "detection/tag_geometry.hpp"

#include <gtest/gtest.h>

#include <random>

#include <Eigen/LU>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/observe.hpp"
#include "support/allocation_counter.hpp"
#include "support/jacobian_check.hpp"
#include "support/lens_models.hpp"

namespace fiducap {
namespace {

/// Intersection of the lines through a and b, and c and d.
Eigen::Vector2d intersection_of(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                                const Eigen::Vector2d& c, const Eigen::Vector2d& d) {
  Eigen::Matrix2d along;
  along << b - a, c - d;
  return a + (b - a) * (along.inverse() * (c - a)).x();
}

/// The corners when the ends of one side are moved across it.
Vector8d corners_when(const TagCorners& px, std::size_t side, double at_first, double at_last) {
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
  const TagCorners slanted{{{100, 180}, {171, 150}, {160, 92}, {88, 120}}};
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

TEST(CornerCovariance, IsFiniteWhereTwoSidesAreNearlyOneLine) {
  std::array<SideSigma, 4> sides;
  sides.fill({0.03, 0.04});
  EXPECT_TRUE(corner_covariance({{{0, 0}, {50, -1e-9}, {100, 0}, {50, -40}}}, sides).allFinite());
}

CameraModel camera() { return {752, 480, 460, 455, 376, 240}; }

TagObservation seen_from(const Pose& X_VT, double edge_m, double noise_px = 0, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss(0, noise_px > 0 ? noise_px : 1);
  TagObservation tag;
  tag.edge_m = edge_m;
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<std::size_t>(i);
    tag.corners_px[k] = camera().pinhole(X_VT * tag_corner(i, edge_m));
    for (int axis = 0; noise_px > 0 && axis < 2; ++axis) tag.corners_px[k](axis) += gauss(random);
    tag.ideal_from_raw[k].setIdentity();
  }
  return tag;
}

// A tag facing the camera: its z axis points back to the camera, its y axis up in the image.
const Eigen::Quaterniond kFacing = exp_so3({M_PI, 0, 0});

TEST(TagCorner, StartsLowerLeftAndRunsCounterClockwise) {
  const Eigen::Vector3d expected[] = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  for (int i = 0; i < 4; ++i) EXPECT_EQ(tag_corner(i, 2.0), expected[i]);
}

TEST(TagPose, FindsTheTruePoseOfExactCorners) {
  for (const Eigen::Vector3d& tilt :
       {Eigen::Vector3d(0.3, 0.1, 0), {-0.5, 0.4, 0.8}, {0.2, -0.9, -2.0}}) {
    const Pose truth{exp_so3(tilt) * kFacing, {0.3, -0.2, 1.5}};
    const auto poses = solve_tag_pose(seen_from(truth, 0.2), camera());
    EXPECT_LT((poses[0].X_VT.p - truth.p).norm(), 1e-6);
    EXPECT_LT(angle_between(poses[0].X_VT.q, truth.q), 1e-6);
    EXPECT_LT(poses[0].rms_px, 1e-6);
    EXPECT_GE(poses[1].rms_px, poses[0].rms_px);
  }
}

TEST(TagPose, HasTheTruePoseAmongTwoWhenFarAndNoisy) {
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
  // At this distance the better one is often wrong, so both are kept.
  EXPECT_GT(better_is_true, kRuns / 3);
  EXPECT_LT(better_is_true, kRuns);
}

/// Both planar poses by OpenCV, not refined.
std::vector<Pose> poses_by_opencv(const TagObservation& tag) {
  std::array<cv::Point3d, 4> object;
  std::array<cv::Point2d, 4> image;
  for (int i = 0; i < 4; ++i) {  // upper left first, clockwise
    const Eigen::Vector3d corner = tag_corner(3 - i, tag.edge_m);
    const Eigen::Vector2d& px = tag.corners_px[static_cast<std::size_t>(3 - i)];
    object[static_cast<std::size_t>(i)] = {corner.x(), corner.y(), corner.z()};
    image[static_cast<std::size_t>(i)] = {(px.x() - camera().cu) / camera().fu,
                                          (px.y() - camera().cv) / camera().fv};
  }
  std::vector<cv::Mat> turns, places;
  cv::solvePnPGeneric(object, image, cv::Matx33d::eye(), cv::noArray(), turns, places, false,
                      cv::SOLVEPNP_IPPE_SQUARE);
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < turns.size(); ++i)
    poses.push_back({exp_so3(Eigen::Vector3d(turns[i].ptr<double>())),
                     Eigen::Vector3d(places[i].ptr<double>())});
  return poses;
}

TEST(TagPose, BothAreAsNearToTheCornersAsThoseOfOpenCvOrNearer) {
  for (unsigned seed = 1; seed <= 200; ++seed) {
    std::srand(seed);
    const Pose truth{exp_so3(Eigen::Vector3d::Random()) * kFacing,
                     Eigen::Vector3d(0, 0, 2) + 0.5 * Eigen::Vector3d::Random()};
    const TagObservation tag = seen_from(truth, 0.2, 0.4, seed);
    const auto poses = solve_tag_pose(tag, camera());
    for (const Pose& other : poses_by_opencv(tag)) {
      const bool is_first =
          angle_between(other.q, poses[0].X_VT.q) < angle_between(other.q, poses[1].X_VT.q);
      const double rms_px = corner_residual(tag, other, camera()).rms_px();
      EXPECT_LE(poses[is_first ? 0 : 1].rms_px, rms_px + 1e-9) << "seed " << seed;
    }
  }
}

TEST(TagPose, AllocatesNothing) {
  const TagObservation tag = seen_from({exp_so3({0.3, 0.1, 0}) * kFacing, {0.3, -0.2, 1.5}}, 0.2);
  const AllocationCounter allocations;
  (void)solve_tag_pose(tag, camera());
  EXPECT_EQ(allocations.count(), 0u);
}

TEST(TagPose, OfCornersOnOneLineOrOfOneCornerHasNoNan) {
  TagObservation tag = seen_from({kFacing, {0, 0, 1}}, 0.2);
  for (const double step_px : {20.0, 0.0}) {
    for (std::size_t i = 0; i < 4; ++i)
      tag.corners_px[i] = {100.0 + step_px * static_cast<double>(i), 100.0};
    for (const TagPose& pose : solve_tag_pose(tag, camera())) {
      EXPECT_FALSE(std::isnan(pose.rms_px));
      EXPECT_TRUE(pose.X_VT.p.allFinite());
    }
  }
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

TEST_P(CornerResidualBent, AccountsForTheFirstCoefficientOfALens) {
  CameraModel configured = camera();
  configured.distortion = GetParam();
  if (GetParam() != Distortion::kNone) configured.coefficients = {-0.2, 0.03};
  if (GetParam() == Distortion::kRational)
    configured.coefficients = {-0.2, 0.03, 1e-3, -1e-3, 0.01, 0.3, -0.1, 0.02};
  constexpr double kMore = -0.07;
  const CameraModel bent = LensOffset{.k1 = kMore}.applied_to(configured);
  const Pose X_VT{exp_so3({0.4, -0.3, 0.2}) * kFacing, {0.4, -0.3, 1.2}};
  TagObservation tag = seen_from(X_VT, 0.2);
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Vector3d p_V = X_VT * tag_corner(i, tag.edge_m);
    tag.raw_px[k] = *bent.project(p_V);
    // Linearised at the projection by the configured lens, which isolates the effect of k1.
    const Eigen::Vector2d px = *configured.project(p_V);
    const auto pixel = undistort(configured, px);
    tag.ideal_from_raw[k] = pixel->ideal_from_raw;
    tag.corners_px[k] = pixel->px + pixel->ideal_from_raw * (tag.raw_px[k] - px);
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
                                         Distortion::kEquidistant, Distortion::kRational));

TEST(LensOffset, GivesALensWithoutDistortionNothingButItsOwn) {
  CameraModel none = camera();
  none.coefficients = {-0.3, 0.1, 0, 0, 0};  // not used while there is no distortion
  const CameraModel bent = LensOffset{.k1 = -0.07}.applied_to(none);
  EXPECT_EQ(bent.distortion, Distortion::kRadialTangential);
  EXPECT_EQ(bent.coefficients, (LensCoefficients{-0.07}));
  EXPECT_EQ(LensOffset{.focal = 0.1}.applied_to(none).distortion, Distortion::kNone);
}

TEST(CornerResidual, ReportsATagBehindTheCamera) {
  const TagObservation tag = seen_from({kFacing, {0, 0, 1}}, 0.2);
  EXPECT_FALSE(corner_residual(tag, {kFacing, {0, 0, -1}}, camera()).in_front);
}

class Observe : public testing::Test {
 protected:
  Observe() {
    frame_.camera = 1;
    frame_.exposed_at = instant_from_ns(42);
    frame_.tags = {sighting(5), sighting(3)};
  }

  static TagSighting sighting(int id) {
    TagSighting s;
    s.tag_id = id;
    s.decision_margin = 60;
    s.corners_px = {Eigen::Vector2d{100, 160}, {150, 160}, {150, 110}, {100, 110}};
    return s;
  }

  const TagObservations& observed() {
    observe(frame_, camera_, tags_, detector_, out_);
    return out_;
  }

  CameraModel camera_{752, 480, 460, 460, 376, 240};
  CornerFrame frame_;
  TagSetConfig tags_;
  DetectorConfig detector_;
  TagObservations out_;
};

TEST_F(Observe, ReturnsTagsSortedByIdWithTheirSizes) {
  tags_.sizes_m[3] = 0.3;
  ASSERT_EQ(observed().tags.size(), 2u);
  EXPECT_EQ(out_.tags[0].tag_id, 3);
  EXPECT_EQ(out_.tags[0].edge_m, 0.3);
  EXPECT_EQ(out_.tags[1].edge_m, 0.16);
  EXPECT_EQ(out_.camera, 1);
  EXPECT_EQ(out_.exposed_at, instant_from_ns(42));
}

TEST_F(Observe, UndistortsTheSameCornersWithAnotherLens) {
  TagObservation tag = observed().tags.front();
  camera_.fu = camera_.fv = 480;
  camera_ = radial_tangential(camera_, {-0.28, 0.07, 2e-4, 2e-5});
  ASSERT_TRUE(undistort_tag(camera_, tag));
  const TagObservation& expected = observed().tags.front();
  EXPECT_GT((expected.corners_px[3] - sighting(3).corners_px[3]).norm(), 5) << "another lens";
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT((tag.corners_px[i] - expected.corners_px[i]).norm(), 1e-9);
    EXPECT_LT((tag.ideal_from_raw[i] - expected.ideal_from_raw[i]).norm(), 1e-9);
  }
}

TEST_F(Observe, UndistortsTrackedPointsOfThisImageOnly) {
  camera_ = radial_tangential(camera_, {-0.28, 0.07, 2e-4, 2e-5});
  frame_.points = {{7, 3, {60, 400}}, {9, 0, {376, 240}}};
  ASSERT_EQ(observed().points.size(), 2u);
  EXPECT_EQ(out_.points[0].track, 7u);
  EXPECT_EQ(out_.points[0].age, 3);
  EXPECT_EQ(out_.points[0].px, undistort(camera_, {60, 400})->px);
  EXPECT_EQ(out_.points[0].ideal_from_raw, undistort(camera_, {60, 400})->ideal_from_raw);
  frame_.points.clear();
  EXPECT_TRUE(observed().points.empty());
}

TEST_F(Observe, DropsIgnoredAndDoubledIds) {
  tags_.ignore = {3};
  ASSERT_EQ(observed().tags.size(), 1u);
  EXPECT_EQ(out_.tags[0].tag_id, 5);
  tags_.ignore = {};
  frame_.tags.push_back(sighting(3));
  ASSERT_EQ(observed().tags.size(), 1u);
  EXPECT_EQ(out_.tags[0].tag_id, 5);
}

TEST_F(Observe, DropsLowMarginsManyBitErrorsAndTwistedCorners) {
  frame_.tags[0].decision_margin = 0;
  EXPECT_EQ(observed().tags.size(), 2u) << "0: the source measures no margin";
  frame_.tags[0].decision_margin = 10;
  frame_.tags[1].hamming = 4;
  EXPECT_TRUE(observed().tags.empty());
  frame_.tags = {sighting(5), sighting(3)};
  std::swap(frame_.tags[0].corners_px[0], frame_.tags[0].corners_px[1]);  // seen from behind
  frame_.tags[1].corners_px[2].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(observed().tags.empty());
}

CameraModel wide_lens() {
  return radial_tangential({752, 480, 458.6, 457.3, 367.2, 248.4},
                           {-0.283, 0.074, 0.0002, 0.00002});
}

const std::array<Eigen::Vector2d, 4> kSquareNearTheEdge{
    Eigen::Vector2d{600, 420}, {700, 415}, {705, 320}, {605, 318}};

TEST(SideBend, UnbendingReturnsTheTrueCornersAndChangesNothingWithoutALens) {
  CameraModel camera = wide_lens();
  const auto fitted = corners_of_fitted_sides(camera, kSquareNearTheEdge).value();
  const auto corrected = unbend_corners(camera, fitted);
  double worst = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& px = kSquareNearTheEdge[i];
    const Eigen::Vector2d raw =
        *camera.project({(px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv, 1.0});
    worst = std::max(worst, (fitted[i] - raw).norm());
    EXPECT_LT((corrected[i] - raw).norm(), 5e-3);
  }
  EXPECT_GT(worst, 0.1) << "there is nothing to correct";
  camera.distortion = Distortion::kNone;
  EXPECT_EQ(unbend_corners(camera, kSquareNearTheEdge), kSquareNearTheEdge);
}

}  // namespace
}  // namespace fiducap
