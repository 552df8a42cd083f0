#include "simulation/images/optics.hpp"

#include <gtest/gtest.h>

#include "still_camera.hpp"

namespace fiducap::simulation {
namespace {

class RayTableOf : public testing::TestWithParam<CameraModel> {};

TEST_P(RayTableOf, EveryRayComesBackToItsPixelCorner) {
  const CameraModel& model = GetParam();
  const RayTable rays(model);
  ASSERT_EQ(rays.columns(), model.width + 1);
  ASSERT_EQ(rays.rows(), model.height + 1);
  constexpr double kFloatAndInterpolation_px = 2e-4;
  for (int row = 0; row < rays.rows(); row += 7) {
    for (int column = 0; column < rays.columns(); column += 5) {
      const auto px = model.project({rays.x(row)[column], rays.y(row)[column], 1.0});
      ASSERT_TRUE(px.has_value());
      ASSERT_LT((*px - Eigen::Vector2d(column - 0.5, row - 0.5)).norm(), kFloatAndInterpolation_px)
          << column << " " << row;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Lenses, RayTableOf,
                         testing::Values(small_camera(), small_lens_camera(),
                                         small_fisheye_camera(), lens_camera()));

TEST(RayTable, WhereTheLensSeesNothingThereIsNoRay) {
  // Radial distortion that folds back at 0.73 of the focal length: the image corners are dark.
  CameraModel model = small_camera();
  model.fu = model.fv = 120;
  model.distortion = Distortion::kRadialTangential;
  model.coefficients = {-0.6, 0, 0, 0, 0};
  const RayTable rays(model);
  EXPECT_TRUE(std::isnan(rays.x(0)[0]));
  EXPECT_FALSE(std::isnan(rays.x(120)[188]));
  EXPECT_LT(rays.widest_rad(), 0.75);
}

}  // namespace
}  // namespace fiducap::simulation
