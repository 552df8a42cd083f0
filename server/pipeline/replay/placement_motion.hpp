#pragma once

#include "base/stamped_pose.hpp"
#include "capture/odometry.hpp"

namespace fiducap {

/// How unlikely it is that a body stood at both, as a squared number of sigmas: by its odometry
/// where there is some, else a body that is carried by hand.
[[nodiscard]] double motion_misfit(const StampedPose& a, const StampedPose& b,
                                   const Odometry* odometry);

}  // namespace fiducap
