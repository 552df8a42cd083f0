#include "calibration/intrinsics/intrinsics_calibration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "calibration/intrinsics/bundle.hpp"
#include "calibration/intrinsics/initial_state.hpp"
#include "calibration/intrinsics/intrinsics_verdict.hpp"
#include "calibration/intrinsics/lens_model.hpp"
#include "calibration_scene.hpp"
#include "estimation/filter/chi_square.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

constexpr double kNoise_px = 0.1;

void quiet(const std::string&) {}

/// Squared error of the estimated numbers in units of their covariance; its mean is their count.
double nees(const IntrinsicsCalibration& c, const CameraModel& truth) {
  const auto n = static_cast<Eigen::Index>(c.free.size());
  Eigen::VectorXd e(n);
  Eigen::MatrixXd P(n, n);
  const LensVector error = numbers_of(c.state.camera) - numbers_of(truth);
  for (Eigen::Index i = 0; i < n; ++i) {
    e(i) = error(c.free[static_cast<std::size_t>(i)]);
    for (Eigen::Index j = 0; j < n; ++j)
      P(i, j) = c.uncertainty.covariance(c.free[static_cast<std::size_t>(i)],
                                         c.free[static_cast<std::size_t>(j)]);
  }
  return e.dot(P.ldlt().solve(e));
}

TEST(LensDerivative, AgreesWithCentralDifferencesAndWithTheCameraModel) {
  for (const CameraModel& camera : {narrow_lens(), fisheye_lens()}) {
    for (const Eigen::Vector3d& p :
         {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1e-8, 0, 1), Eigen::Vector3d(0.3, -0.2, 0.9)}) {
      const LensDerivative at = differentiate(camera, p);
      EXPECT_LT((at.px - *camera.project(p)).norm(), 1e-9);
      const LensVector size = (LensVector() << 100, 100, 100, 100, 1, 1, 1, 1, 1).finished();
      const auto by_lens = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        CameraModel moved = camera;
        set_numbers(moved, numbers_of(camera) + size.cwiseProduct(LensVector(d)));
        return differentiate(moved, p).px;
      };
      expect_jacobian(at.d_lens * size.asDiagonal(), by_lens);
      const auto by_point = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        return differentiate(camera, p + Eigen::Vector3d(d)).px;
      };
      // Next to the axis a step is larger than the distance from it: third order is left.
      expect_jacobian(at.d_point, by_point, 1e-6, 1e-5);
    }
  }
}

class BothLenses : public ::testing::TestWithParam<Distortion> {
 protected:
  CameraModel truth() const {
    return GetParam() == Distortion::kEquidistant ? fisheye_lens() : narrow_lens();
  }
  IntrinsicsOptions this_lens() const { return {{GetParam()}, true}; }
};

INSTANTIATE_TEST_SUITE_P(Intrinsics, BothLenses,
                         ::testing::Values(Distortion::kRadialTangential,
                                           Distortion::kEquidistant));

TEST_P(BothLenses, FocalSearchNeedsNoStartValue) {
  CalibrationScene scene(truth());
  scene.add_tags(3, 2);
  scene.look(30, kNoise_px);
  const auto starts = search_focal_length(scene.data, GetParam());
  ASSERT_FALSE(starts.empty());
  const double ratio = starts.front().camera.fu / truth().fu;
  EXPECT_GT(ratio, 0.7);  // what the adjustment reaches
  EXPECT_LT(ratio, 1.4);
}

// 8 runs of 8 numbers each: their sum is chi-square with 64 degrees of freedom.
TEST_P(BothLenses, TheErrorOfACheckerboardCalibrationMatchesItsCovariance) {
  constexpr int kRuns = 8;
  double sum = 0;
  double numbers = 0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    CalibrationScene scene(truth(), seed);
    scene.add_checkerboard(8, 6, 0.04);
    scene.look(40, kNoise_px);
    const auto result = calibrate_intrinsics(scene.data, this_lens(), quiet);
    ASSERT_TRUE(result) << result.error().text();
    EXPECT_NEAR(result->sigma_px, kNoise_px, 0.1 * kNoise_px);
    sum += nees(*result, truth());
    numbers += static_cast<double>(result->free.size());
  }
  EXPECT_LT(sum, chi_square_quantile(static_cast<int>(numbers), 0.999));
  EXPECT_GT(sum, 0.4 * numbers);  // not too large either
}

TEST_P(BothLenses, TheErrorOfACalibrationFromTagsOfUnknownPosesMatchesItsCovariance) {
  constexpr int kRuns = 8;
  double sum = 0;
  double numbers = 0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    CalibrationScene scene(truth(), 100 + seed);
    scene.add_tags(3, 2);
    scene.look(40, kNoise_px);
    const auto result = calibrate_intrinsics(scene.data, this_lens(), quiet);
    ASSERT_TRUE(result) << result.error().text();
    EXPECT_TRUE(result->targets_joined);
    sum += nees(*result, truth());
    numbers += static_cast<double>(result->free.size());
  }
  EXPECT_LT(sum, chi_square_quantile(static_cast<int>(numbers), 0.999));
  EXPECT_GT(sum, 0.4 * numbers);
}

TEST_P(BothLenses, ASingleTagHeldEverywhereIsEnough) {
  CalibrationScene scene(truth());
  scene.add_tags(1, 1);
  scene.look(150, kNoise_px);
  const auto result = calibrate_intrinsics(scene.data, this_lens(), quiet);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_LT(nees(*result, truth()),
            chi_square_quantile(static_cast<int>(result->free.size()), 0.9999));
  EXPECT_NEAR(result->state.camera.fu / truth().fu, 1, 0.02);
}

TEST_P(BothLenses, TheRightLensIsChosen) {
  CalibrationScene scene(truth());
  scene.add_checkerboard(8, 6, 0.04);
  scene.look(40, kNoise_px);
  const auto result = calibrate_intrinsics(scene.data, {}, quiet);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_EQ(result->state.camera.distortion, GetParam());
  EXPECT_EQ(result->trials.size(), 2U);
}

TEST_P(BothLenses, OutliersAreRemoved) {
  CalibrationScene scene(truth());
  scene.add_tags(3, 2);
  scene.look(40, kNoise_px);
  std::size_t spoilt = 0;
  for (std::size_t v = 0; v < scene.data.views.size(); v += 8) {
    scene.data.views[v].sightings.front().points[1].raw_px += Eigen::Vector2d(12, -7);
    scene.data.views[v].sightings.front().points[1].px += Eigen::Vector2d(12, -7);
    ++spoilt;
  }
  const auto result = calibrate_intrinsics(scene.data, this_lens(), quiet);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_GE(result->rejected, spoilt);
  EXPECT_LT(nees(*result, truth()),
            chi_square_quantile(static_cast<int>(result->free.size()), 0.9999));
}

TEST_P(BothLenses, TagsThatMoveRelativeToEachOtherAreDetected) {
  CalibrationScene scene(truth());
  scene.add_tags(3, 2);
  scene.look(60, kNoise_px, 0.95, 0.7, true);
  const auto result = calibrate_intrinsics(scene.data, this_lens(), quiet);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_TRUE(result->targets_disagree);
  EXPECT_FALSE(result->targets_joined);
  EXPECT_LT(nees(*result, truth()),
            chi_square_quantile(static_cast<int>(result->free.size()), 0.9999));
}

TEST_P(BothLenses, AGoodRecordingIsGradedGood) {
  CalibrationScene scene(truth());
  scene.add_tags(3, 2);
  scene.look(80, kNoise_px);
  const auto result = calibrate_intrinsics(scene.data, this_lens(), quiet);
  ASSERT_TRUE(result) << result.error().text();
  const auto verdict = assess(*result, make_image_map(*result));
  EXPECT_EQ(verdict.grade, IntrinsicsGrade::kGood)
      << (verdict.advice.empty() ? "" : verdict.advice.front());
  EXPECT_GT(verdict.covered, 0.8);
  EXPECT_LT(verdict.misfit_px, 0.05);
}

TEST_P(BothLenses, UncertaintyIsLargerWithoutPoints) {
  CalibrationScene scene(truth(), 7);
  scene.add_checkerboard(8, 6, 0.04);
  scene.look(40, kNoise_px, 0.5);  // corners are not seen: there it is worst
  const auto result = calibrate_intrinsics(scene.data, this_lens(), quiet);
  ASSERT_TRUE(result) << result.error().text();
  const ImageMap map = make_image_map(*result);
  double inside = 0, outside = 0;
  int n_inside = 0, n_outside = 0;
  for (const ImageCell& cell : map.cells) {
    if (!cell.in_lens) continue;
    (cell.points > 0 ? inside : outside) += cell.uncertainty_px;
    ++(cell.points > 0 ? n_inside : n_outside);
  }
  ASSERT_GT(n_inside, 0);
  ASSERT_GT(n_outside, 0);
  EXPECT_GT(outside / n_outside, 1.5 * inside / n_inside);
}

TEST_P(BothLenses, AdvisesToMoveABoardFromTheMiddleToTheCorners) {
  CalibrationScene scene(truth());
  scene.add_checkerboard(5, 4, 0.02);
  scene.look(40, kNoise_px, 0.3);
  const auto result = calibrate_intrinsics(scene.data, this_lens(), quiet);
  ASSERT_TRUE(result) << result.error().text();
  const auto verdict = assess(*result, make_image_map(*result));
  EXPECT_NE(verdict.grade, IntrinsicsGrade::kGood);
  ASSERT_FALSE(verdict.advice.empty());
  std::string all;
  for (const std::string& advice : verdict.advice) all += advice;
  EXPECT_THAT(all, HasSubstr("corner"));
}

TEST_P(BothLenses, ABoardThatIsNeverTiltedIsNotGood) {
  CalibrationScene scene(truth());
  scene.add_checkerboard(5, 4, 0.02);
  scene.look(40, kNoise_px, 0.3, 0.0);
  const auto result = calibrate_intrinsics(scene.data, this_lens(), quiet);
  if (!result) {
    EXPECT_THAT(result.error().text(), HasSubstr("tilt"));
    return;
  }
  const auto verdict = assess(*result, make_image_map(*result));
  EXPECT_NE(verdict.grade, IntrinsicsGrade::kGood);
}

TEST(TargetLayout, GroupsWithoutCommonImagesAreSplitWithoutMotion) {
  CalibrationScene scene(narrow_lens());
  scene.add_tags(3, 2);
  scene.look(30, 0);
  CalibrationState state = joined_state(scene.data, narrow_lens());
  EXPECT_THAT(state.group_of, ::testing::Each(0));
  constexpr double kRounding_px = 1e-6;
  ASSERT_LT(rms_per_coordinate(residuals(scene.data, state)), kRounding_px);
  for (std::size_t v = 0; v < scene.data.views.size(); ++v)
    std::erase_if(scene.data.views[v].sightings,
                  [&](const TargetSighting& s) { return (s.target < 3) == (v % 2 == 0); });
  split_groups(scene.data, state);
  EXPECT_THAT(state.group_of, ::testing::ElementsAre(0, 0, 0, 3, 3, 3));
  EXPECT_LT(rms_per_coordinate(residuals(scene.data, state)), kRounding_px);
}

TEST(Intrinsics, FourImagesAreRefused) {
  CalibrationScene scene(narrow_lens());
  scene.add_checkerboard(8, 6, 0.04);
  scene.look(4, kNoise_px);
  const auto result = calibrate_intrinsics(scene.data, {}, quiet);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().text(), HasSubstr("too few data"));
}

TEST(Intrinsics, RandomPixelsAreRefusedOrUseless) {
  CalibrationScene scene(narrow_lens());
  scene.add_checkerboard(8, 6, 0.04);
  scene.look(30, 60.0);
  const auto result = calibrate_intrinsics(scene.data, {}, quiet);
  if (!result) return;
  EXPECT_EQ(assess(*result, make_image_map(*result)).grade, IntrinsicsGrade::kUseless);
}

}  // namespace
}  // namespace fiducap
