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
/// "Radius" is the polynomial's variable: tan θ for radial-tangential, θ for equidistant lenses.
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
  /// 1 + k1 s + k2 s² …, s = radius²
  using Polynomial = std::array<double, 5>;

  [[nodiscard]] DistortedPoint distort_radial_tangential(const Eigen::Vector2d& ideal) const;
  [[nodiscard]] DistortedPoint distort_equidistant(const Eigen::Vector2d& ideal) const;
  /// Removes the radial part alone. @return the ideal point on the ray through `raw`.
  [[nodiscard]] std::optional<Eigen::Vector2d> undistort_radius(const Eigen::Vector2d& raw,
                                                                double limit) const;

  Distortion kind_;
  Polynomial scale_;  ///< raw radius = radius × scale
  Polynomial slope_;  ///< d raw radius / d radius
  double p1_;
  double p2_;
};

/// Derivative of the raw point by k1, in which it is linear; focal length 1, centre (0, 0).
class FirstBend final {
 public:
  /// @param distortion  kNone: as radial-tangential
  FirstBend(Distortion distortion, const Eigen::Vector2d& ideal);

  [[nodiscard]] Eigen::Vector2d point() const { return along_ * ideal_; }
  [[nodiscard]] Eigen::Matrix2d raw_from_ideal() const;

 private:
  Eigen::Vector2d ideal_;
  double along_;  ///< point / ideal: r², or θ³ / r
  double slope_;  ///< d along / d r²
};

}  // namespace fiducap
