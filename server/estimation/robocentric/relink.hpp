#pragma once

#include <optional>
#include <span>

#include "capture/camera_model.hpp"
#include "estimation/robocentric/corner_update.hpp"
#include "estimation/robocentric/propagation.hpp"

namespace fiducap::robocentric {

// "Unknown" for a linear filter that is linearised at the right place; velocity and rate as at a start.
inline constexpr double kUnknownStep_m = 30.0;
inline constexpr double kUnknownTurn_rad = 2.0;
inline constexpr double kStartVelocity_m_s = 1.0;
inline constexpr double kStartRate_rad_s = 1.0;  // without IMU

/// What is known beforehand about the motion since the last image.
struct StepGuess {
  Pose X_B0B;
  double position_sigma_m{};
  double rotation_sigma_rad{};
};

/// The motion since the state's time that explains an image, and how much worse the next different answer is.
struct StepFound {
  Pose X_B0B;
  double evidence{};  ///< Chi-square by which the best answer beats the best clearly different one; ∞ when there is none.
};

/// Finds the motion from the tags of one image alone: each tag in the state (or known) with each of its two planar
/// poses proposes a motion, the one that explains all tags and the guess best wins. No linearisation, so it holds
/// after any gap.
/// @pre `state` stands at the start of the motion
/// @return nullopt when no tag proposes a possible motion
[[nodiscard]] std::optional<StepFound> find_step(const FilterState& state, int camera, const CameraModel& model,
                                                 std::span<const TagToUse> tags, const StepGuess& guess,
                                                 double corner_noise_px);

/// Moves the body's mean by X_B0B, velocity to zero. The step is linearised where the corners say it is, so it may be as
/// uncertain as it likes.
/// @return the motion to hand to FrameTransition
[[nodiscard]] MotionSinceImage step_by_unknown_motion(FilterState& state, const Pose& X_B0B, bool has_imu);

}  // namespace fiducap::robocentric
