#include "capture/lens/camera_model.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "capture/lens/lens.hpp"

namespace fiducap {
namespace {

// Ideal pinhole pixels diverge towards 90°.
constexpr double kWidestRay_rad = 1.55;

Eigen::Vector2d normalized(const CameraModel& camera, const Eigen::Vector2d& px) {
  return {(px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv};
}

Eigen::Vector2d pixel(const CameraModel& camera, const Eigen::Vector2d& normalized_px) {
  return {camera.fu * normalized_px.x() + camera.cu, camera.fv * normalized_px.y() + camera.cv};
}

}  // namespace

std::optional<Eigen::Vector2d> CameraModel::project(const Eigen::Vector3d& p_VP) const {
  if (!(p_VP.z() > 0) || !p_VP.allFinite()) return std::nullopt;
  const Eigen::Vector2d ideal = p_VP.head<2>() / p_VP.z();
  if (!ideal.allFinite()) return std::nullopt;
  if (distortion == Distortion::kNone) return pixel(*this, ideal);
  const Lens lens(*this);
  if (lens.folds_back_before(lens.radius_of(ideal))) return std::nullopt;
  const DistortedPoint raw = lens.distort(ideal);
  if (!(raw.raw_from_ideal.determinant() > 0)) return std::nullopt;
  return pixel(*this, raw.point);
}

std::vector<ConfigError> CameraModel::check() const {
  constexpr double kLargestImage_px = 65535;
  Checker checker{""};
  checker.within("width", width, 1, kLargestImage_px)
      .within("height", height, 1, kLargestImage_px)
      .positive("fu", fu)
      .positive("fv", fv)
      .within("cu", cu, -1.0 * width, 2.0 * width)
      .within("cv", cv, -1.0 * height, 2.0 * height);
  for (std::size_t i = 0; i < coefficients.size(); ++i)
    checker.require(std::isfinite(coefficients[i]), "coefficients[" + std::to_string(i) + "]",
                    coefficients[i], "must be finite");
  const std::size_t used = coefficients_of(distortion);
  for (std::size_t i = used; i < coefficients.size() && distortion != Distortion::kNone; ++i)
    checker.require(coefficients[i] == 0, "coefficients[" + std::to_string(i) + "]",
                    coefficients[i],
                    "must be 0: this lens has " + std::to_string(used) + " coefficients");
  return checker.errors;
}

std::span<const double> listed_coefficients(const CameraModel& camera) {
  const bool is_short =
      camera.distortion == Distortion::kRadialTangential && camera.coefficients[4] == 0;
  return std::span(camera.coefficients).first(is_short ? 4 : coefficients_of(camera.distortion));
}

std::optional<UndistortedPixel> undistort(const CameraModel& camera, const Eigen::Vector2d& raw_px,
                                          double max_angle_rad) {
  const Eigen::Vector2d raw = normalized(camera, raw_px);
  if (!raw.allFinite()) return std::nullopt;
  const double max_angle = std::min(max_angle_rad, kWidestRay_rad);
  if (camera.distortion == Distortion::kNone) {
    if (std::atan(raw.norm()) > max_angle) return std::nullopt;
    return UndistortedPixel{raw_px, Eigen::Matrix2d::Identity()};
  }
  const std::optional<Eigen::Vector2d> ideal = Lens(camera).undistort(raw, max_angle);
  if (!ideal) return std::nullopt;
  const Eigen::Matrix2d ideal_from_raw = Lens(camera).distort(*ideal).raw_from_ideal.inverse();
  const Eigen::DiagonalMatrix<double, 2> focal(camera.fu, camera.fv);
  return UndistortedPixel{pixel(camera, *ideal), focal * ideal_from_raw * focal.inverse()};
}

}  // namespace fiducap
