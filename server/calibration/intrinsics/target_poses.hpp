#pragma once

#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// One of the poses that one sighting allows.
struct TargetPose {
  Pose X_VT;
  double rms_px{};  ///< Root mean square over points.
};

/// Both planar poses of a target, the better one first; empty where the camera cannot see such
/// pixels. The pose of a single tag is its least squares pose, that of a board a first guess.
[[nodiscard]] std::vector<TargetPose> poses_of(const CalibrationTarget& target,
                                               const TargetSighting& sighting,
                                               const CameraModel& camera);

/// Root mean square over the points of a sighting; a point that cannot be seen counts as `lost_px`.
[[nodiscard]] double reprojection_rms_px(const CalibrationTarget& target,
                                         const TargetSighting& sighting, const CameraModel& camera,
                                         const Pose& X_VT, double lost_px);

}  // namespace fiducap
