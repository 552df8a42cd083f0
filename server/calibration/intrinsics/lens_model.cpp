#include "calibration/intrinsics/lens_model.hpp"

#include <algorithm>
#include <array>
#include <numbers>

#include <ceres/jet.h>

#include "capture/lens/lens.hpp"

namespace fiducap {
namespace {

constexpr int kRaster = 24;  // pixels tested along each side of the image
constexpr double kWidestRay_rad = 1.55;
constexpr double kRim_rad = 1.3;

enum class Reach { kInFront, kBehind, kFolded };

/// Equidistant lenses see beside and behind the camera.
Reach reach_of_equidistant(const CameraModel& camera, double wanted) {
  constexpr double kStep_rad = 0.01;
  const auto& k = camera.coefficients;
  double last = 0;
  for (double angle = kStep_rad; angle < std::numbers::pi; angle += kStep_rad) {
    const double s = angle * angle;
    const double radius = angle * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
    if (radius >= wanted) return angle <= kWidestRay_rad ? Reach::kInFront : Reach::kBehind;
    // The rim of a fisheye: outside of the image circle the polynomial is arbitrary.
    if (radius <= last) return angle <= kRim_rad ? Reach::kFolded : Reach::kBehind;
    last = radius;
  }
  return Reach::kBehind;
}

Reach reach_of(const CameraModel& camera, const Eigen::Vector2d& px) {
  const Eigen::Vector2d raw((px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv);
  if (camera.distortion == Distortion::kNone) return Reach::kInFront;
  if (camera.distortion == Distortion::kEquidistant)
    return reach_of_equidistant(camera, raw.norm());
  return Lens(camera).undistort(raw, kWidestRay_rad) ? Reach::kInFront : Reach::kFolded;
}

/// Width over height of existing pixels: square, NTSC and PAL video, 1440 for 1920 columns, half of
/// the columns or of the rows.
constexpr std::array<double, 7> kPixelAspects{1.0,       10.0 / 11, 12.0 / 11, 4.0 / 3.0,
                                              3.0 / 4.0, 2.0,       0.5};

}  // namespace

LensVector numbers_of(const CameraModel& camera) {
  LensVector numbers;
  numbers << camera.fu, camera.fv, camera.cu, camera.cv,
      Eigen::Map<const Eigen::Matrix<double, kLensNumbers - 4, 1>>(camera.coefficients.data());
  return numbers;
}

void set_numbers(CameraModel& camera, const LensVector& numbers) {
  camera.fu = numbers(0);
  camera.fv = numbers(1);
  camera.cu = numbers(2);
  camera.cv = numbers(3);
  for (std::size_t i = 0; i < camera.coefficients.size(); ++i)
    camera.coefficients[i] = numbers(4 + static_cast<Eigen::Index>(i));
}

LensDerivative differentiate(const CameraModel& camera, const Eigen::Vector3d& p_VP) {
  using Jet = ceres::Jet<double, kLensNumbers + 3>;
  const LensVector numbers = numbers_of(camera);
  std::array<Jet, kLensNumbers> lens;
  std::array<Jet, 3> point;
  std::array<Jet, 2> px;
  for (int i = 0; i < kLensNumbers; ++i) lens[static_cast<std::size_t>(i)] = Jet(numbers(i), i);
  for (int i = 0; i < 3; ++i) point[static_cast<std::size_t>(i)] = Jet(p_VP(i), kLensNumbers + i);
  project_through(camera.distortion, lens.data(), point.data(), px.data());
  LensDerivative out;
  for (int row = 0; row < 2; ++row) {
    const Jet& coordinate = px[static_cast<std::size_t>(row)];
    out.px(row) = coordinate.a;
    out.d_lens.row(row) = coordinate.v.head<kLensNumbers>().transpose();
    out.d_point.row(row) = coordinate.v.tail<3>().transpose();
  }
  return out;
}

LensShape shape_of(const CameraModel& camera) {
  LensShape shape;
  for (int row = 0; row <= kRaster; ++row)
    for (int column = 0; column <= kRaster; ++column) {
      const Reach reach = reach_of(
          camera, {column * (camera.width - 1.0) / kRaster, row * (camera.height - 1.0) / kRaster});
      shape.folded += reach == Reach::kFolded ? 1 : 0;
      shape.behind += reach == Reach::kBehind ? 1 : 0;
    }
  constexpr double kAll = (kRaster + 1) * (kRaster + 1);
  shape.folded /= kAll;
  shape.behind /= kAll;
  shape.aspect = camera.fu / camera.fv;
  const auto off = [&](double built) { return std::abs(shape.aspect * built - 1); };
  shape.pixel_aspect =
      *std::ranges::min_element(kPixelAspects, [&](double a, double b) { return off(a) < off(b); });
  shape.aspect_off = off(shape.pixel_aspect);
  shape.centre_off = std::max(std::abs((camera.cu + 0.5) / camera.width - 0.5),
                              std::abs((camera.cv + 0.5) / camera.height - 0.5));
  return shape;
}

bool can_be_a_lens(const LensShape& shape) {
  const bool square = shape.pixel_aspect == 1;
  return shape.folded <= kMostFolded && shape.centre_off <= kMostCentreOff &&
         shape.aspect_off <= (square ? kMostAspectOff : kMostOddAspectOff);
}

}  // namespace fiducap
