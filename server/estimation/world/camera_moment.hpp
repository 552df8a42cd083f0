#pragma once

#include <cmath>

#include <Eigen/Core>

#include "estimation/filter/tag_measurement.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

using Matrix63d = Eigen::Matrix<double, 6, 3>;

/// A camera's pose at a moment near the state's, and how its world-side error depends on the
/// state's errors.
///
/// The rigid body carries the camera: X_WV' = M X_WV with M = X_WB' X_WB⁻¹, hence ξ_V' = Ad(M) ξ_V
/// + the error of M.
struct CameraAt {
  double seconds{};
  Pose X_WV;
  Matrix6d on_camera{Matrix6d::Identity()};
  Matrix6d on_body{Matrix6d::Zero()};
  Matrix63d on_velocity{Matrix63d::Zero()};
  Matrix63d on_gyro_bias{Matrix63d::Zero()};
  Vector6d on_time;  ///< the twist

  /// Less moves nothing by a nanometre.
  [[nodiscard]] bool moved() const { return std::abs(seconds) > 1e-9; }
};

/// @param seconds  after the state's instant, or before it
[[nodiscard]] CameraAt camera_at(const FilterState& state, int camera, double seconds);

/// The error of that pose as a function of the state's errors.
[[nodiscard]] SharedPose error_of(const CameraAt& at, int camera);

}  // namespace fiducap::world
