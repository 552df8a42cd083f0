#include "simulation/sensor_models.hpp"

#include <gtest/gtest.h>

#include "base/pose.hpp"
#include "robot.hpp"
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

constexpr double kGravity = 9.81;

ImuErrors no_errors() {
  ImuErrors errors;
  errors.noise = {0, 0, 0, 0, 200.0};
  errors.gyro_bias.setZero();
  errors.accel_bias.setZero();
  return errors;
}

const Eigen::Vector3d kUp(0, 0, kGravity);

Trajectory::Point at_rest() {
  return {{}, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
}

TEST(ImuModel, IntegratesToTheTrajectoryWithoutErrors) {
  // The error of mid-point integration at 1 kHz over 10 s is below this; wrong signs give metres.
  constexpr double kIntegration_m = 1e-4;
  const auto trajectory = make_trajectory({}, room_of("hall")).value();
  ImuModel imu(no_errors(), kGravity, 1);
  constexpr double kStep_s = 1e-3;
  Pose X = trajectory->at(0).X_WB;
  Eigen::Vector3d v = trajectory->at(0).v_WB;
  for (int k = 0; k < 10000; ++k) {
    const ImuSample middle = imu.measure(0, trajectory->at((k + 0.5) * kStep_s));
    const Eigen::Quaterniond q_middle = X.q * exp_so3(middle.w_WB_B * (0.5 * kStep_s));
    const Eigen::Vector3d a = q_middle * middle.f_B - kUp;
    X.p += v * kStep_s + 0.5 * a * kStep_s * kStep_s;
    v += a * kStep_s;
    X.q = (X.q * exp_so3(middle.w_WB_B * kStep_s)).normalized();
  }
  EXPECT_LT((X.p - trajectory->at(10).X_WB.p).norm(), kIntegration_m);
  EXPECT_LT(angle_between(X.q, trajectory->at(10).X_WB.q), kIntegration_m);
}

TEST(ImuModel, HasWhiteNoiseOfDensityTimesRootOfRate) {
  for (const double rate : {100.0, 400.0}) {
    ImuErrors errors = no_errors();
    errors.noise = {1e-3, 0, 2e-2, 0, rate};
    ImuModel imu(errors, kGravity, 3);
    constexpr int kSamples = 20000;
    double gyro = 0;
    double accel = 0;
    double mean_of_100 = 0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = 0; k < kSamples; ++k) {
      const ImuSample s = imu.measure(static_cast<std::uint64_t>(k), at_rest());
      const Eigen::Vector3d f = s.f_B - kUp;
      gyro += s.w_WB_B.squaredNorm();
      accel += f.squaredNorm();
      sum += s.w_WB_B;
      if (k % 100 == 99) {
        mean_of_100 += (sum / 100).squaredNorm();
        sum.setZero();
      }
    }
    constexpr double kFiveSigma = 5 * 1.4142 / 245;
    EXPECT_NEAR(gyro / (3 * kSamples) / (1e-6 * rate), 1.0, kFiveSigma);
    EXPECT_NEAR(accel / (3 * kSamples) / (4e-4 * rate), 1.0, kFiveSigma);
    // White: the mean of 100 has a hundredth of the variance (Allan's −1/2 slope).
    EXPECT_NEAR(mean_of_100 / (3 * kSamples / 100.0) / (1e-8 * rate), 1.0, 10 * kFiveSigma);
  }
}

TEST(ImuModel, BiasSpreadsWithTheRootOfTime) {
  ImuErrors errors = no_errors();
  errors.noise.gyro_walk_rad_s2_rtHz = 2e-5;
  errors.noise.accel_walk_m_s3_rtHz = 5e-4;
  for (const double t : {1.0, 100.0, 5000.0}) {
    double gyro = 0;
    double accel = 0;
    constexpr int kUnits = 1000;
    for (std::uint64_t seed = 0; seed < kUnits; ++seed) {
      const ImuBias bias = ImuModel(errors, kGravity, seed).bias_at(t);
      gyro += bias.w.squaredNorm() / 3;
      accel += bias.f.squaredNorm() / 3;
    }
    constexpr double kFiveSigma = 5 * 1.4142 / 54.8;
    EXPECT_NEAR(gyro / kUnits / (4e-10 * t), 1.0, kFiveSigma);
    EXPECT_NEAR(accel / kUnits / (25e-8 * t), 1.0, kFiveSigma);
  }
}

TEST(ImuModel, HasTheTrueBiasInItsSamples) {
  ImuErrors errors;
  errors.noise.gyro_noise_rad_s_rtHz = 0;
  errors.noise.accel_noise_m_s2_rtHz = 0;
  ImuModel imu(errors, kGravity, 4);
  for (std::uint64_t k = 0; k < 1000; k += 37) {
    const ImuSample sample = imu.measure(k, at_rest());
    const ImuBias bias = imu.bias_at(static_cast<double>(k) / errors.noise.rate_hz);
    EXPECT_LT((sample.w_WB_B - bias.w).norm(), 1e-12);
    EXPECT_LT((sample.f_B - kUp - bias.f).norm(), 1e-12);
  }
}

TEST(ImuModel, HasScaleAndMisalignmentOfTheirSizePerSeed) {
  ImuErrors errors = no_errors();
  errors.scale_error = 0.01;
  errors.misalignment_rad = 0.003;
  double scale = 0;
  double tilt = 0;
  constexpr int kUnits = 2000;
  Trajectory::Point turning = at_rest();
  turning.w_WB_B = Eigen::Vector3d::UnitX();
  for (std::uint64_t seed = 0; seed < kUnits; ++seed) {
    const Eigen::Vector3d w = ImuModel(errors, kGravity, seed).measure(0, turning).w_WB_B;
    scale += std::pow(w.x() - 1, 2);
    tilt += (w.y() * w.y() + w.z() * w.z()) / 2;
  }
  constexpr double kFiveSigma = 5 * 1.4142 / 44.7;
  EXPECT_NEAR(scale / kUnits / 1e-4, 1.0, kFiveSigma);
  EXPECT_NEAR(tilt / kUnits / 9e-6, 1.0, kFiveSigma);
}

TEST(ImuModel, SaturatesAtItsRange) {
  ImuErrors errors = no_errors();
  errors.gyro_range_rad_s = 5;
  errors.accel_range_m_s2 = 20;
  Trajectory::Point wild = at_rest();
  wild.w_WB_B = {9, -9, 1};
  wild.a_WB = {100, 0, -100};
  const ImuSample sample = ImuModel(errors, kGravity, 1).measure(0, wild);
  EXPECT_EQ(sample.w_WB_B, Eigen::Vector3d(5, -5, 1));
  EXPECT_EQ(sample.f_B, Eigen::Vector3d(20, 0, -20));
}

TEST(RandomWalk, HasIndependentStepsOfVarianceOne) {
  RandomWalk walk(5, Purpose::kGyroWalk);
  constexpr std::uint64_t kSteps = 20000;
  double square = 0;
  double neighbours = 0;
  Eigen::Vector3d last_step = Eigen::Vector3d::Zero();
  for (std::uint64_t k = 0; k < kSteps; ++k) {
    const Eigen::Vector3d before = walk.at(k);
    const Eigen::Vector3d step = walk.at(k + 1) - before;
    square += step.squaredNorm();
    neighbours += step.dot(last_step);
    last_step = step;
  }
  constexpr double kFiveSigma = 5 * 1.4142 / 245;  // √2 / √(3 · 20000)
  EXPECT_NEAR(square / (3.0 * kSteps), 1.0, kFiveSigma);
  EXPECT_NEAR(neighbours / (3.0 * kSteps), 0.0, kFiveSigma);
}

TEST(RandomWalk, StartsAtZeroAndDependsOnPurposeAndSeedButNotOnTheOrderOfRequests) {
  RandomWalk forward(9, Purpose::kGyroWalk);
  std::vector<Eigen::Vector3d> seen;
  for (std::uint64_t k = 0; k < 500; ++k) seen.push_back(forward.at(k));
  RandomWalk backward(9, Purpose::kGyroWalk);
  (void)backward.at(1'000'000'000'000);
  for (std::uint64_t k = 500; k-- > 0;) EXPECT_EQ(backward.at(k), seen[k]);
  EXPECT_EQ(RandomWalk(1, Purpose::kGyroWalk).at(0).norm(), 0.0);
  EXPECT_NE(RandomWalk(1, Purpose::kGyroWalk).at(10), RandomWalk(1, Purpose::kAccelWalk).at(10));
  EXPECT_NE(RandomWalk(1, Purpose::kGyroWalk).at(10), RandomWalk(2, Purpose::kGyroWalk).at(10));
}

}  // namespace
}  // namespace fiducap::simulation
