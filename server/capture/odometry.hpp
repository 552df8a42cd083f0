#pragma once

#include <optional>
#include <vector>

#include "base/stamped_pose.hpp"

namespace fiducap {

/// How a body moved, as another program reckons it: wheels, or a phone that tracks itself. Poses in
/// axes O of its own, z up, that drift against the room: used are the motion between them, and what
/// is up.
struct Odometry {
  std::vector<StampedPose> poses;  ///< X_OB, by time, strictly increasing.
  /// Of the drift, 1-sigma after a second; it grows with the root of time.
  double move_noise_m{0.01};
  double turn_noise_rad{0.002};

  /// It has a pose at this instant, or before and after it, not more than two seconds apart.
  [[nodiscard]] bool covers(Instant at) const;
  /// X_OB, by its neighbours. @pre covers(at)
  [[nodiscard]] Pose pose_at(Instant at) const;
  /// The body at `to` in the body at `from`; nullopt where one of them is not covered.
  [[nodiscard]] std::optional<Pose> motion(Instant from, Instant to) const;
};

}  // namespace fiducap
