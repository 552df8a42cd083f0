#pragma once

#include <optional>
#include <vector>

#include "base/pose.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

/// Control poses of the *camera* (X_WV) for a closed motion at equal steps of time.
struct MotionPlan {
  std::vector<Pose> X_WV;
  double spacing_s{};
  /// What the camera shall just reach: time is stretched or squeezed to meet the first of them. 0:
  /// taken as it is.
  double speed_m_s{};
  double rate_rad_s{};
  double acceleration_m_s2{};  ///< Of the body.
};

/// @return nullopt for a kind that is not planned from the room (`file`, unknown).
[[nodiscard]] std::optional<MotionPlan> plan_motion(const TrajectoryConfig& config,
                                                    const RoomConfig& room);

/// Camera axes at p looking at the target, image top towards `up` as far as possible.
[[nodiscard]] Pose look_at(const Eigen::Vector3d& p, const Eigen::Vector3d& target,
                           const Eigen::Vector3d& up);

}  // namespace fiducap::simulation
