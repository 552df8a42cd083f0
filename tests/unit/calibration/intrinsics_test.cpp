#include "calibration/intrinsics/intrinsics_calibration.hpp"

#include <gmock/gmock.h>

#include <array>
#include <stdexcept>

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
  const LensVector error = numbers_of(c.state.camera) - numbers_of(truth);
  const Eigen::MatrixXd S = selection(std::vector<int>(c.free.begin(), c.free.end()), error.size());
  return squared_distance(S * error, propagated(S, c.uncertainty.covariance));
}

double limit(const IntrinsicsCalibration& c, double probability) {
  return chi_square_quantile(static_cast<int>(c.free.size()), probability);
}

TEST(LensDerivative, AgreesWithCentralDifferencesAndWithTheCameraModel) {
  for (const CameraModel& camera : {narrow_lens(), fisheye_lens(), rational_lens()}) {
    for (const Eigen::Vector3d& p :
         {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1e-8, 0, 1), Eigen::Vector3d(0.3, -0.2, 0.9)}) {
      const LensDerivative at = differentiate(camera, p);
      EXPECT_LT((at.px - *camera.project(p)).norm(), 1e-9);
      LensVector size = LensVector::Ones();
      size.head<4>().setConstant(100);
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
  static CameraModel truth() {
    return GetParam() == Distortion::kEquidistant ? fisheye_lens() : narrow_lens();
  }
  static CalibrationScene with_tags(int columns = 3, int rows = 2, std::uint64_t seed = 1) {
    CalibrationScene scene(truth(), seed);
    scene.add_tags(columns, rows);
    return scene;
  }
  static CalibrationScene with_board(int columns, int rows, double square_m,
                                     std::uint64_t seed = 1) {
    CalibrationScene scene(truth(), seed);
    scene.add_checkerboard(columns, rows, square_m);
    return scene;
  }
  /// Expects a result.
  static IntrinsicsCalibration calibrated(const CalibrationScene& scene, bool any_lens = false) {
    const IntrinsicsOptions this_lens{{GetParam()}, true};
    const auto result =
        calibrate_intrinsics(scene.data, any_lens ? IntrinsicsOptions{} : this_lens, quiet);
    if (!result) throw std::runtime_error(result.error().text());
    return *result;
  }
};

/// Sum of the squared errors of several runs: chi-square, and not too small.
struct ErrorSum {
  void add(const IntrinsicsCalibration& result, const CameraModel& truth) {
    sum += nees(result, truth);
    numbers += static_cast<int>(result.free.size());
  }
  void expect_consistent() const {
    EXPECT_LT(sum, chi_square_quantile(numbers, 0.999));
    EXPECT_GT(sum, 0.4 * numbers);
  }
  double sum{0};
  int numbers{0};
};

INSTANTIATE_TEST_SUITE_P(Intrinsics, BothLenses,
                         ::testing::Values(Distortion::kRadialTangential,
                                           Distortion::kEquidistant));

TEST_P(BothLenses, FocalSearchNeedsNoStartValue) {
  CalibrationScene scene = with_tags();
  scene.look(30, kNoise_px);
  const auto starts = search_focal_length(scene.data, GetParam());
  ASSERT_FALSE(starts.empty());
  const double ratio = starts.front().camera.fu / truth().fu;
  EXPECT_GT(ratio, 0.7);  // what the adjustment reaches
  EXPECT_LT(ratio, 1.4);
}

constexpr std::uint64_t kRuns = 8;

TEST_P(BothLenses, TheErrorOfACalibrationMatchesItsCovariance) {
  for (const bool from_tags : {false, true}) {
    ErrorSum errors;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      CalibrationScene scene =
          from_tags ? with_tags(3, 2, 100 + seed) : with_board(8, 6, 0.04, seed);
      scene.look(40, kNoise_px);
      const auto result = calibrated(scene);
      if (from_tags)
        EXPECT_TRUE(result.targets_joined);
      else
        EXPECT_NEAR(result.sigma_px, kNoise_px, 0.1 * kNoise_px);
      errors.add(result, truth());
    }
    errors.expect_consistent();
  }
}

TEST_P(BothLenses, ASingleTagHeldEverywhereIsEnough) {
  CalibrationScene scene = with_tags(1, 1);
  scene.look(150, kNoise_px);
  const auto result = calibrated(scene);
  EXPECT_LT(nees(result, truth()), limit(result, 0.9999));
  EXPECT_NEAR(result.state.camera.fu / truth().fu, 1, 0.02);
}

TEST_P(BothLenses, TheRightLensIsChosen) {
  CalibrationScene scene = with_board(8, 6, 0.04);
  scene.look(40, kNoise_px);
  const auto result = calibrated(scene, true);
  EXPECT_EQ(result.state.camera.distortion, GetParam());
  EXPECT_EQ(result.trials.size(), 2U);
}

TEST_P(BothLenses, OutliersAreRemoved) {
  CalibrationScene scene = with_tags();
  scene.look(40, kNoise_px);
  std::size_t outliers = 0;
  for (std::size_t v = 0; v < scene.data.views.size(); v += 8, ++outliers) {
    auto& point = scene.data.views[v].sightings.front().points[1];
    point.raw_px += Eigen::Vector2d(12, -7);
    point.px += Eigen::Vector2d(12, -7);
  }
  const auto result = calibrated(scene);
  EXPECT_GE(result.rejected, outliers);
  EXPECT_LT(nees(result, truth()), limit(result, 0.9999));
}

TEST_P(BothLenses, TagsThatMoveRelativeToEachOtherAreDetected) {
  CalibrationScene scene = with_tags();
  scene.look(60, kNoise_px, 0.95, 0.7, true);
  const auto result = calibrated(scene);
  EXPECT_TRUE(result.targets_disagree);
  EXPECT_FALSE(result.targets_joined);
  EXPECT_LT(nees(result, truth()), limit(result, 0.9999));
}

TEST_P(BothLenses, UncertaintyIsLargerWithoutPoints) {
  CalibrationScene scene = with_board(8, 6, 0.04, 7);
  scene.look(40, kNoise_px, 0.5);  // corners are not seen: there it is worst
  std::array<double, 2> sum_px{};
  std::array<int, 2> count{};
  const ImageMap map = make_image_map(calibrated(scene));
  for (const ImageCell& cell : map.cells) {
    if (!cell.in_lens) continue;
    const std::size_t has_points = cell.points > 0 ? 1 : 0;
    sum_px[has_points] += cell.uncertainty_px;
    ++count[has_points];
  }
  EXPECT_THAT(count, ::testing::Each(::testing::Gt(0)));
  EXPECT_GT(sum_px[0] / count[0], 1.5 * sum_px[1] / count[1]);
}

// Its numerator and denominator nearly cancel: none of their coefficients is determined alone.
TEST(RationalLens, IsFoundWithItsCovariance) {
  constexpr double kFine_px = 0.02;
  ErrorSum errors;
  std::uint64_t rational = 0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    CalibrationScene scene(rational_lens(), seed);
    scene.add_checkerboard(8, 6, 0.04);
    scene.look(40, kFine_px);
    const auto result = calibrate_intrinsics(scene.data, {{Distortion::kRational}, true}, quiet);
    ASSERT_TRUE(result) << result.error().text();
    // A pole beside the boards, with every prior: radial-tangential instead.
    if (result->state.camera.distortion != Distortion::kRational) continue;
    ++rational;
    EXPECT_EQ(result->free.size(), static_cast<std::size_t>(kLensNumbers));
    EXPECT_NEAR(result->sigma_px, kFine_px, 0.1 * kFine_px);
    errors.add(*result, rational_lens());
  }
  EXPECT_GE(rational, kRuns - 1);
  errors.expect_consistent();
}

TEST(RationalLens, WithoutADenominatorIsRadialTangential) {
  CalibrationScene scene(narrow_lens());
  scene.add_checkerboard(8, 6, 0.04);
  scene.look(40, kNoise_px);
  const auto result = calibrate_intrinsics(scene.data, {{Distortion::kRational}, true}, quiet);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_EQ(result->state.camera.distortion, Distortion::kRadialTangential);
  EXPECT_LT(nees(*result, narrow_lens()), limit(*result, 0.9999));
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

}  // namespace
}  // namespace fiducap
