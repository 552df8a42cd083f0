#pragma once

#include "capture/lens/camera_model.hpp"
#include "detection/corner_projection.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// One tag in one image against a body pose and a tag pose, both in W. Raw pixels, as
/// CornerResidual. A pose moves by six numbers: position (m, W axes), then attitude (rotation
/// vector in W axes, q ← exp(δ) q).
struct SightingResidual {
  Vector8d y{Vector8d::Zero()};         ///< seen − predicted.
  Matrix86d d_body{Matrix86d::Zero()};  ///< ∂y / ∂ body pose.
  Matrix86d d_tag{Matrix86d::Zero()};   ///< ∂y / ∂ tag pose.
  bool in_front{true};  ///< False: a corner lies behind the camera, the rest means nothing.
};

[[nodiscard]] SightingResidual sighting_residual(const TagObservation& seen,
                                                 const CameraMount& camera, const Pose& X_WB,
                                                 const Pose& X_WT);

/// Squared norm, in units of the noise, at which a sighting pulls hardest; beyond, the further off
/// the weaker: 5 sigma on each of the eight numbers. An honest sighting (8 ± 4) counts nearly
/// whole.
inline constexpr double kLossBend = 8 * 5.0 * 5.0;

/// What a sighting counts in the refinement: Cauchy loss of its squared norm, in units of the
/// noise.
[[nodiscard]] double robust_square(const Vector8d& y, double corner_noise_px);

/// A pose against survey knowledge: difference in the coordinates of KnownTag::covariance.
struct PriorResidual {
  Eigen::Matrix<double, 6, 1> y{Eigen::Matrix<double, 6, 1>::Zero()};
  Matrix6d d_tag{Matrix6d::Zero()};  ///< ∂y / ∂ tag pose.
};

[[nodiscard]] PriorResidual prior_residual(const Pose& X_WT, const Pose& X_WT_surveyed);

}  // namespace fiducap
