#pragma once

#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"

// Start values of the adjustment: focal length, poses of targets, layout of targets.
namespace fiducap {

/// One of the poses that one sighting allows.
struct TargetPose {
  Pose X_VT;
  double rms_px{};  ///< Root mean square over points.
};

/// Both planar poses of a target, the better one first; empty for pixels outside of the lens model.
/// The pose of a single tag is its least-squares pose, that of a board a first guess.
[[nodiscard]] std::vector<TargetPose> poses_of(const CalibrationTarget& target,
                                               const TargetSighting& sighting,
                                               const CameraModel& camera);

/// Root mean square over the points of a sighting, each limited to `lost_px`.
[[nodiscard]] double reprojection_rms_px(const CalibrationTarget& target,
                                         const TargetSighting& sighting, const CameraModel& camera,
                                         const Pose& X_VT, double lost_px);

/// A start value of the camera: principal point in the middle, no distortion, one focal length.
struct FocalStart {
  CameraModel camera;
  double rms_px{};  ///< Median over sightings of the reprojection error of their own poses.
};

/// Tries focal lengths from wide to narrow. Tags and boards cover a small part of the image, so
/// that at the right focal length nearly all of them fit without distortion; holds for fisheyes as
/// well.
/// @return the local minima, best first; empty when no target is visible with any
[[nodiscard]] std::vector<FocalStart> search_focal_length(const CalibrationData& data,
                                                          Distortion kind);

/// A state in which each target is its own group, at the pose that fits best. Removes sightings
/// without a pose from `data`.
[[nodiscard]] CalibrationState separate_state(CalibrationData& data, const CameraModel& camera);

/// A state in which targets connected by common images form groups of constant relative poses. Of
/// the poses allowed by each sighting, those are used on which the images agree.
/// @param camera  accurate enough for poses of targets
[[nodiscard]] CalibrationState joined_state(const CalibrationData& data, const CameraModel& camera);

/// Splits groups whose targets are no longer connected by common images, because sightings were
/// removed; their relative poses would be undetermined.
void split_groups(const CalibrationData& data, CalibrationState& state);

}  // namespace fiducap
