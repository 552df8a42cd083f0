#pragma once

#include <Eigen/Core>

#include "base/pose.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

/// How brightly things come out: the light where they are, times what the camera's automatic
/// exposure makes of it.
///
/// The exposure is right for the light where the camera *was*: it follows with a lag, so whoever
/// walks out into the sun sees everything white for a moment, and on the way back everything black.
/// Stateless: the same instant always has the same exposure.
class Lighting final {
 public:
  Lighting(const DaylightConfig& sun, double lag_s) : daylight_(sun), lag_s_(lag_s) {}

  /// Light at a place, 1 without daylight.
  [[nodiscard]] double at(const Eigen::Vector3d& p_W) const;
  /// What the camera multiplies light by at t: 1 long after the last daylight, 1 / factor when it
  /// has been in it for long.
  [[nodiscard]] double exposure(const Trajectory& trajectory, const Pose& X_BV, double t_s) const;
  [[nodiscard]] bool even() const { return daylight_.factor == 1.0; }

 private:
  DaylightConfig daylight_;
  double lag_s_;
};

}  // namespace fiducap::simulation
