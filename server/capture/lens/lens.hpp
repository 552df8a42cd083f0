#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// A raw point and its derivative by the ideal one, at focal length 1, principal point (0, 0).
struct DistortedPoint {
  Eigen::Vector2d point;
  Eigen::Matrix2d raw_from_ideal;  ///< ∂ raw / ∂ ideal
};

/// The lens of a CameraModel at focal length 1: ideal pinhole point ↔ raw point.
///
/// OpenCV has the same formulas, but its fixed-point `undistortPoints` diverges silently for strong
/// lenses, `fisheye::undistortPoints` clamps the angle, neither detects a folded polynomial and
/// both allocate. This is a bracketed Newton iteration; tests compare it with OpenCV.
///
/// "Radius" is the polynomial's variable: θ for equidistant lenses, tan θ for the others.
class Lens final {
 public:
  /// @pre camera.distortion != Distortion::kNone
  explicit Lens(const CameraModel& camera);

  [[nodiscard]] double radius_of(const Eigen::Vector2d& ideal) const;
  /// True when the raw radius stops growing somewhere between the centre and `radius`.
  [[nodiscard]] bool folds_back_before(double radius) const;
  [[nodiscard]] DistortedPoint distort(const Eigen::Vector2d& ideal) const;
  /// @return nullopt when no ideal point within `max_angle_rad` and the fold has this raw point.
  [[nodiscard]] std::optional<Eigen::Vector2d> undistort(const Eigen::Vector2d& raw,
                                                         double max_angle_rad) const;

 private:
  /// c0 + c1 s + c2 s² …, s = radius²
  using Polynomial = std::array<double, 7>;

  [[nodiscard]] bool grows_at(double radius) const;
  [[nodiscard]] double raw_radius(double radius) const;
  /// Where the raw radius first stops growing, or `limit` when it does not before.
  [[nodiscard]] double fold(double limit) const;
  [[nodiscard]] DistortedPoint distort_radial_tangential(const Eigen::Vector2d& ideal) const;
  [[nodiscard]] DistortedPoint distort_equidistant(const Eigen::Vector2d& ideal) const;
  /// Removes the radial part alone. @return the ideal point on the ray through `raw`.
  [[nodiscard]] std::optional<Eigen::Vector2d> undistort_radius(const Eigen::Vector2d& raw,
                                                                double limit) const;

  Distortion kind_;
  // raw radius = radius × above / below; d raw radius / d radius = slope / below²
  Polynomial above_;
  Polynomial below_;
  Polynomial slope_;
  double p1_;
  double p2_;
};

/// Derivative of the raw point by k1, in which it is linear; focal length 1, centre (0, 0).
class FirstBend final {
 public:
  /// @param camera  without distortion: as radial-tangential
  FirstBend(const CameraModel& camera, const Eigen::Vector2d& ideal);

  [[nodiscard]] Eigen::Vector2d point() const { return along_ * ideal_; }
  [[nodiscard]] Eigen::Matrix2d raw_from_ideal() const;

 private:
  Eigen::Vector2d ideal_;
  double along_;  ///< point / ideal: r², θ³ / r, or r² / (1 + k4 r² …)
  double slope_;  ///< d along / d r²
};

}  // namespace fiducap
