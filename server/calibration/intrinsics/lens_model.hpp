#pragma once

#include <array>
#include <cmath>
#include <tuple>

#include <Eigen/Core>

#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// The parameters of a lens in the order of all matrices here: fu fv cu cv, then
/// CameraModel::coefficients.
inline constexpr int kLensNumbers = 4 + int{std::tuple_size_v<LensCoefficients>};
using LensVector = Eigen::Matrix<double, kLensNumbers, 1>;

[[nodiscard]] LensVector numbers_of(const CameraModel& camera);
void set_numbers(CameraModel& camera, const LensVector& numbers);

/// CameraModel::project for any number type (automatic derivatives). Smooth for equidistant lenses
/// beside and behind the camera; does not detect folded lenses.
/// @param lens   as numbers_of
/// @param point  camera axes V; other lenses than equidistant ones need z > 0
template <typename T>
void project_through(Distortion kind, const T* lens, const T* point, T* px) {
  using std::atan2;
  using std::sqrt;
  const T* k = lens + 4;
  T x, y;
  if (kind == Distortion::kEquidistant) {
    const T r2 = point[0] * point[0] + point[1] * point[1];
    T scale = T(1) / point[2];  // on the axis
    if (r2 > 1e-16 * point[2] * point[2]) {
      const T r = sqrt(r2);
      const T angle = atan2(r, point[2]);
      const T s = angle * angle;
      scale = angle * (T(1) + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3])))) / r;
    }
    x = point[0] * scale;
    y = point[1] * scale;
  } else {
    const T a = point[0] / point[2];
    const T b = point[1] / point[2];
    const T s = a * a + b * b;
    T radial = T(1) + s * (k[0] + s * (k[1] + s * k[4]));
    if (kind == Distortion::kRational) radial /= T(1) + s * (k[5] + s * (k[6] + s * k[7]));
    x = a * radial + T(2) * k[2] * a * b + k[3] * (s + T(2) * a * a);
    y = b * radial + k[2] * (s + T(2) * b * b) + T(2) * k[3] * a * b;
  }
  px[0] = lens[0] * x + lens[2];
  px[1] = lens[1] * y + lens[3];
}

/// A raw pixel with its derivatives.
struct LensDerivative {
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, kLensNumbers> d_lens;  ///< ∂ px / ∂ (fu fv cu cv k…)
  Eigen::Matrix<double, 2, 3> d_point;            ///< ∂ px / ∂ p_VP
};

/// @pre p_VP.z() > 0 unless the lens is equidistant
[[nodiscard]] LensDerivative differentiate(const CameraModel& camera, const Eigen::Vector3d& p_VP);

/// Plausibility of a lens, independent of residuals.
struct LensShape {
  /// Share of the image that no ray reaches: two directions map to one pixel before. At a raster of
  /// pixels with the corners.
  double folded{};
  double behind{};        ///< Share that only rays from beside or behind the camera reach.
  double aspect{};        ///< fu / fv.
  double pixel_aspect{};  ///< The nearest one of existing pixel shapes; 1: square.
  double aspect_off{};    ///< Relative difference of `aspect` from it.
  /// Distance of the principal point from the middle, in widths or heights, the larger value.
  double centre_off{};
};
[[nodiscard]] LensShape shape_of(const CameraModel& camera);

/// Limits of real cameras. Parameters beyond them fit the corners and nothing else.
inline constexpr double kMostFolded = 0.02;
inline constexpr double kMostAspectOff = 0.02;      // of square pixels
inline constexpr double kMostOddAspectOff = 0.005;  // of others; many ratios are near one of them
inline constexpr double kMostCentreOff = 0.3;
[[nodiscard]] bool can_be_a_lens(const LensShape& shape);

}  // namespace fiducap
