#include "simulation/sensor_models.hpp"

#include <gtest/gtest.h>

#include "base/pose.hpp"
#include "simulation/images/optics.hpp"
#include "still_camera.hpp"

namespace fiducap::simulation {
namespace {

/// A tag of 0.2 m at the origin, facing z; the camera 2 m in front of it, upright.
class CornerCamera : public testing::Test {
 protected:
  CornerCamera() {
    tags_ = {tag_at(7, 0.2)};
    X_WV_ = {exp_so3({std::numbers::pi, 0, 0}), {0, 0, 2}};
    rules_.corner_noise_px = 0;
    rules_.miss_probability = 0;
  }
  std::vector<TagSighting> see(std::uint64_t k = 0) {
    std::vector<TagSighting> out;
    sight_corners(
        plain_camera(), [this](double) { return X_WV_; }, tags_, rules_, {1, 0, k}, out);
    return out;
  }
  std::vector<RecordedTag> tags_;
  Pose X_WV_;
  CameraSimulation rules_;
};

TEST_F(CornerCamera, OrdersCornersFromBottomLeftCounterClockwise) {
  const auto seen = see();
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_EQ(seen[0].tag_id, 7);
  const double h = 460 * 0.1 / 2;  // half an edge in pixels
  const std::array<Eigen::Vector2d, 4> off{{{-h, h}, {h, h}, {h, -h}, {-h, -h}}};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT((seen[0].corners_px[i] - Eigen::Vector2d(375.5, 239.5) - off[i]).norm(), 1e-9) << i;
}

TEST_F(CornerCamera, HasUnbiasedNoiseOfItsSigma) {
  rules_.corner_noise_px = 0.4;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double square = 0;
  constexpr int kImages = 5000;
  const double h = 460 * 0.1 / 2;
  for (std::uint64_t k = 0; k < kImages; ++k) {
    const Eigen::Vector2d error =
        see(k).at(0).corners_px[0] - Eigen::Vector2d(375.5 - h, 239.5 + h);
    sum += error;
    square += error.squaredNorm();
  }
  EXPECT_LT((sum / kImages).norm(), 5 * 0.4 / 70.7);
  EXPECT_NEAR(square / (2 * kImages) / 0.16, 1.0, 5 * 0.0142);
}

TEST_F(CornerCamera, ReportsNoTagThatIsTooSmallOutsideOrBehind) {
  X_WV_.p.z() = 460 * 0.2 / 16.1;
  EXPECT_EQ(see().size(), 1u);
  X_WV_.p.z() = 460 * 0.2 / 15.9;
  EXPECT_TRUE(see().empty()) << "too small";
  X_WV_.p = {1.52, 0, 2};  // left corners at 375.5 − 230 · 1.62 > 0
  EXPECT_EQ(see().size(), 1u);
  X_WV_.p.x() = 1.54;
  EXPECT_TRUE(see().empty()) << "outside";
  X_WV_ = {Eigen::Quaterniond::Identity(), {0, 0, 2}};
  EXPECT_TRUE(see().empty()) << "behind the camera";
}

TEST_F(CornerCamera, ReportsNoTagThatIsTooSlantedOrFromBehind) {
  rules_.min_side_px = 0;
  const auto seen_from = [&](double tilt) {
    X_WV_ = Pose{exp_so3({0, tilt, 0}), Eigen::Vector3d::Zero()} *
            Pose{exp_so3({std::numbers::pi, 0, 0}), {0, 0, 2}};
    return see().size();
  };
  EXPECT_EQ(seen_from(1.25), 1u);
  EXPECT_EQ(seen_from(1.26), 0u);
  EXPECT_EQ(seen_from(std::numbers::pi), 0u);
}

TEST_F(CornerCamera, MissesItsShareOfTags) {
  rules_.miss_probability = 0.2;
  int missed = 0;
  for (std::uint64_t k = 0; k < 5000; ++k) missed += see(k).empty() ? 1 : 0;
  EXPECT_NEAR(missed / 5000.0, 0.2, 5 * 0.4 / 70.7);
}

TEST_F(CornerCamera, SortsSightingsAndDropsDoubledIds) {
  tags_ = {tag_at(9, 0.2, {-0.3, 0, 0}), tag_at(3, 0.2), tag_at(5, 0.2, {0.3, 0, 0}),
           tag_at(9, 0.2, {0, 0.3, 0})};
  const auto seen = see();
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_EQ(seen[0].tag_id, 3);
  EXPECT_EQ(seen[1].tag_id, 5);
}

class RayTableOf : public testing::TestWithParam<CameraModel> {};

TEST_P(RayTableOf, RaysProjectToTheirPixelCorners) {
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

TEST(RayTable, HasNoRayWhereTheLensSeesNothing) {
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
