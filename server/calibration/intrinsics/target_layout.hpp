#pragma once

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// A state in which every sighting stands for itself: each target its own group, at the pose that
/// fits best. Sightings without a pose are taken out of `data`.
[[nodiscard]] CalibrationState loose_state(CalibrationData& data, const CameraModel& camera);

/// Finds where targets stand relative to each other, as if none ever moved: targets that are
/// connected by common images become one group. Of the poses that each sighting allows, those are
/// taken on which the images agree.
/// @param camera  good enough that a target's pose means something
[[nodiscard]] CalibrationState joined_state(const CalibrationData& data, const CameraModel& camera);

/// Groups whose targets are no longer connected by common images (sightings were taken out) come
/// apart; otherwise nothing would say where the parts stand relative to each other.
void split_groups(const CalibrationData& data, CalibrationState& state);

}  // namespace fiducap
