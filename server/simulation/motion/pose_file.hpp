#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "simulation/motion/pose_spline.hpp"

namespace fiducap::simulation {

/// A recorded pose; seconds since the first one of its file.
struct TimedPose {
  double t_s{};
  Pose X_WB;
};

/// Reads EuRoC truth (commas: ns, p, q w first, anything after) or TUM (blanks: s, p, q w last).
/// `#` starts a comment.
/// @return at least kOrder poses of strictly increasing time; Error with file and line else.
[[nodiscard]] Expected<std::vector<TimedPose>> read_pose_file(const std::string& path);

/// The smoothest spline near the poses: least squares with a penalty on the fourth difference of
/// its control poses (P. Eilers, B. Marx, "Flexible smoothing with B-splines and penalties", 1996).
/// Gaps are bridged smoothly.
[[nodiscard]] PoseSpline fit_spline(const std::vector<TimedPose>& poses);

}  // namespace fiducap::simulation
