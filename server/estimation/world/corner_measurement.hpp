#pragma once

#include <Eigen/Core>
#include <cmath>
#include <span>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/filter/corner_noise.hpp"
#include "estimation/filter/tag_measurement.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

using Matrix63d = Eigen::Matrix<double, 6, 3>;

/// A camera's pose at a time near the state's, and the derivative of its world-side error by the
/// state's errors.
///
/// The body is rigid: X_WV' = M X_WV with M = X_WB' X_WB⁻¹, so ξ_V' = Ad(M) ξ_V + the error of M.
struct CameraAt {
  double seconds{};
  Pose X_WV;
  Matrix6d on_camera{Matrix6d::Identity()};
  Matrix6d on_body{Matrix6d::Zero()};
  Matrix63d on_velocity{Matrix63d::Zero()};
  Matrix63d on_gyro_bias{Matrix63d::Zero()};
  Vector6d on_time;  ///< the twist

  /// Shorter times move the camera by less than a nanometre.
  [[nodiscard]] bool moved() const { return std::abs(seconds) > 1e-9; }
};

/// @param seconds  after the body's instant; may be negative
[[nodiscard]] CameraAt camera_at(const MovingBody& body, const Pose& X_BV, double seconds);
[[nodiscard]] inline CameraAt camera_at(const FilterState& state, int camera, double seconds) {
  return camera_at(state, state.X_BV[static_cast<std::size_t>(camera)], seconds);
}

/// The error of that pose as a function of the state's errors.
[[nodiscard]] SharedPose error_of(const CameraAt& at, int camera);

/// A configured lens and its estimated offset.
struct EstimatedLens {
  const CameraModel& model;
  const LensOffset& offset;
};

/// Corners of one tag, RCARS II-D4: X_VT = X_WV⁻¹ X_WT. Camera and tag enter with opposite signs
/// and the same lever arm, so a common motion cancels exactly at any linearisation point.
struct TagCorners {
  Vector8d y;  ///< seen − predicted, raw pixels
  bool in_front{};
  Matrix86d H;  ///< ∂ predicted / ∂ the tag's world-side error; by the camera's it is −H.
  CameraParameterMatrix H_camera;  ///< By readout, focal length, principal point, distortion.
  Vector8d H_size;                 ///< By the relative size.
};
/// @param size  factor on the configured edge
[[nodiscard]] TagCorners corners_of(const CameraAt& at, const EstimatedLens& lens,
                                    const TagObservation& seen, const Pose& X_WT, double size);

/// Innovation and Jacobian of one tag (corners_of()), by the filter's state.
[[nodiscard]] TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model,
                                     const TagToUse& tag, const CornerNoise& noise);

/// All tags of an image. With a global shutter they share the camera's pose and have the relative
/// form: equivalent to measure(), with fewer numbers.
void measure_image(const FilterState& state, int camera, const CameraModel& model,
                   std::span<const TagToUse> tags, const CornerNoise& noise, ImageMeasurement& out);

/// Pose of the tag in W: in the state or given.
[[nodiscard]] const Pose& place_of(const FilterState& state, const TagToUse& tag);

}  // namespace fiducap::world
