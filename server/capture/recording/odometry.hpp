#pragma once

#include <optional>
#include <vector>

#include "base/pose.hpp"

namespace fiducap {

/// Motion of a body by another program: wheels, or a phone that tracks itself. Poses in axes O of
/// its own, z up, that drift against the workspace: relative motion and the vertical are used.
struct Odometry {
  std::vector<StampedPose> poses;  ///< X_OB, by time, strictly increasing.
  // Drift, 1-sigma after one second; it grows with the root of time.
  double move_noise_m{0.01};
  double turn_noise_rad{0.002};

  /// There is a pose at this instant, or poses around it at most two seconds apart.
  [[nodiscard]] bool covers(Instant at) const;
  /// X_OB, interpolated. @pre covers(at)
  [[nodiscard]] Pose pose_at(Instant at) const;
  /// The body at `to` in the body at `from`; nullopt where one of them is not covered.
  [[nodiscard]] std::optional<Pose> motion(Instant from, Instant to) const;
};

}  // namespace fiducap
