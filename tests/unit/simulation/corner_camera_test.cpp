#include "simulation/sensor_models.hpp"

#include <gtest/gtest.h>

#include "base/pose.hpp"
#include "robot.hpp"

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

TEST_F(CornerCamera, CornersComeBottomLeftFirstCounterClockwise) {
  const auto seen = see();
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_EQ(seen[0].tag_id, 7);
  const double h = 460 * 0.1 / 2;  // half an edge in pixels
  const std::array<Eigen::Vector2d, 4> expected{{{375.5 - h, 239.5 + h},
                                                 {375.5 + h, 239.5 + h},
                                                 {375.5 + h, 239.5 - h},
                                                 {375.5 - h, 239.5 - h}}};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT((seen[0].corners_px[i] - expected[i]).norm(), 1e-9) << i;
}

TEST_F(CornerCamera, NoiseHasItsSigmaAndNoMean) {
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

TEST_F(CornerCamera, ATagThatIsTooSmallIsNotReported) {
  X_WV_.p.z() = 460 * 0.2 / 16.1;
  EXPECT_EQ(see().size(), 1u);
  X_WV_.p.z() = 460 * 0.2 / 15.9;
  EXPECT_TRUE(see().empty());
}

TEST_F(CornerCamera, ATagSeenTooFlatOrFromBehindIsNotReported) {
  rules_.min_side_px = 0;
  const auto look_from = [&](double tilt) {
    X_WV_ = Pose{exp_so3({0, tilt, 0}), Eigen::Vector3d::Zero()} *
            Pose{exp_so3({std::numbers::pi, 0, 0}), {0, 0, 2}};
    return see().size();
  };
  EXPECT_EQ(look_from(1.25), 1u);
  EXPECT_EQ(look_from(1.26), 0u);
  EXPECT_EQ(look_from(std::numbers::pi), 0u);
}

TEST_F(CornerCamera, ATagThatLeavesTheImageIsNotReported) {
  X_WV_.p.x() = 1.52;  // left corners at 375.5 − 230 · 1.62 > 0
  EXPECT_EQ(see().size(), 1u);
  X_WV_.p.x() = 1.54;
  EXPECT_TRUE(see().empty());
}

TEST_F(CornerCamera, ATagBehindTheCameraIsNotReported) {
  X_WV_.q = Eigen::Quaterniond::Identity();
  EXPECT_TRUE(see().empty());
}

TEST_F(CornerCamera, SomeAreMissed) {
  rules_.miss_probability = 0.2;
  int missed = 0;
  for (std::uint64_t k = 0; k < 5000; ++k) missed += see(k).empty() ? 1 : 0;
  EXPECT_NEAR(missed / 5000.0, 0.2, 5 * 0.4 / 70.7);
}

TEST_F(CornerCamera, SightingsAreSortedAndADoubledIdIsLeftOut) {
  tags_ = {tag_at(9, 0.2, {-0.3, 0, 0}), tag_at(3, 0.2), tag_at(5, 0.2, {0.3, 0, 0}),
           tag_at(9, 0.2, {0, 0.3, 0})};
  const auto seen = see();
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_EQ(seen[0].tag_id, 3);
  EXPECT_EQ(seen[1].tag_id, 5);
}

}  // namespace
}  // namespace fiducap::simulation
