#pragma once

#include <span>
#include <vector>

#include "capture/lens/camera_model.hpp"
#include "estimation/robocentric/corner_measurement.hpp"
#include "estimation/robocentric/propagation.hpp"
#include "estimation/start/resection.hpp"

namespace fiducap::robocentric {

/// The tags of an image in the body axes of the state's time, B0, for find_place(): what it answers
/// is the motion since.
[[nodiscard]] std::vector<SightedTag> tags_at_start(const FilterState& state, int camera,
                                                    const CameraModel& model,
                                                    std::span<const TagToUse> tags);

/// Moves the body's mean by X_B0B, velocity to zero. The step is linearised where the corners say
/// it is, so it may be as uncertain as it likes.
/// @return the motion to hand to FrameTransition
[[nodiscard]] MotionSinceImage step_by_unknown_motion(FilterState& state, const Pose& X_B0B,
                                                      bool has_imu);

}  // namespace fiducap::robocentric
