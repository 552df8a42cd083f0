#pragma once

#include "base/pose.hpp"
#include "estimation/body_estimate.hpp"
#include "pipeline/body_pose.hpp"

namespace fiducap {

/// Carries the state of a body from its IMU axes B to its pivot P: pose, twist, acceleration and
/// covariance.
///
/// The lever arm p_BP turns body rate into velocity and centripetal acceleration. Its third part,
/// angular acceleration × arm, is left out: no sensor measures it and differentiated gyro noise
/// would drown it.
/// @param rate_variance  (rad/s)² per axis: noise of the body rate beyond its bias, independent of
/// the state
/// @param out  X_WP v_WP w_WP_P a_WP covariance are written, nothing else
void write_pivot(const BodyEstimate& body, const Pose& X_BP, double rate_variance, BodyPose& out);

}  // namespace fiducap
