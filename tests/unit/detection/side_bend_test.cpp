#include "detection/side_bend.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

CameraModel wide_lens() {
  CameraModel c;
  c.width = 752;
  c.height = 480;
  c.fu = 458.6;
  c.fv = 457.3;
  c.cu = 367.2;
  c.cv = 248.4;
  c.distortion = Distortion::kRadialTangential;
  c.coefficients = {-0.283, 0.074, 0.0002, 0.00002, 0};
  return c;
}

const std::array<Eigen::Vector2d, 4> kSquareNearTheEdge{
    Eigen::Vector2d{600, 420}, {700, 415}, {705, 320}, {605, 318}};

TEST(SideBend, ALensPushesFittedCornersOff) {
  const CameraModel camera = wide_lens();
  const auto fitted = corners_of_fitted_sides(camera, kSquareNearTheEdge);
  ASSERT_TRUE(fitted);
  double worst = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& px = kSquareNearTheEdge[i];
    const auto raw =
        camera.project({(px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv, 1.0});
    worst = std::max(worst, ((*fitted)[i] - *raw).norm());
  }
  EXPECT_GT(worst, 0.1) << "there is nothing to correct";
}

TEST(SideBend, UnbendingGivesTheTrueCorners) {
  const CameraModel camera = wide_lens();
  const auto corrected =
      unbend_corners(camera, *corners_of_fitted_sides(camera, kSquareNearTheEdge));
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& px = kSquareNearTheEdge[i];
    const auto raw =
        camera.project({(px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv, 1.0});
    EXPECT_LT((corrected[i] - *raw).norm(), 5e-3);
  }
}

TEST(SideBend, WithoutALensNothingChanges) {
  CameraModel camera = wide_lens();
  camera.distortion = Distortion::kNone;
  EXPECT_EQ(unbend_corners(camera, kSquareNearTheEdge), kSquareNearTheEdge);
}

}  // namespace
}  // namespace fiducap
