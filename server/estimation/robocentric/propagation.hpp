#pragma once

#include <Eigen/Core>

#include "base/pose.hpp"
#include "estimation/imu/inertial_input.hpp"
#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

/// What happened between two images, accumulated over the inertial steps, so that an inertial step
/// costs the same whatever the number of tags: the tags and the map's covariance are moved once per
/// image (frame_transition.hpp).
struct MotionSinceImage {
  Pose X_B0B;  ///< Body now, in the body axes of the last image.
  MotionFromBody Phi{
      MotionFromBody::Identity()};       ///< ∂ (body, step) now / ∂ body at the last image.
  MotionMatrix Q{MotionMatrix::Zero()};  ///< Covariance of what was added on the way.

  void restart() { *this = MotionSinceImage{}; }
};

/// Jacobian and noise of one inertial step in the coordinates (body, step since image) of
/// state_layout.hpp.
struct StepJacobians {
  MotionMatrix F{MotionMatrix::Identity()};
  Eigen::Matrix<double, layout::kMotionSize, 3> G_w{};  ///< of white gyro noise, held over the step
  Eigen::Matrix<double, layout::kMotionSize, 3>
      G_f{};  ///< of white accelerometer noise, held over the step
};

/// Moves the body's mean over dt under one reading. RCARS II-D3, eq. for r, v, q and, through
/// X_B0B, for r_T and q_T. The paper steps by Euler; here rotation is exact and the force is turned
/// by half of it, so that honest IMU noise needs no inflation (rcars_study: end-sample rectangle
/// rule).
/// @param gravity_W  e.g. (0, 0, -9.81)
StepJacobians step_mean(FilterState& state, MotionSinceImage& motion, const InertialInput& input,
                        const Eigen::Vector3d& gravity_W, double dt);

/// One inertial step: mean, Φ and Q. The covariance of `state` itself is not touched.
void propagate(FilterState& state, MotionSinceImage& motion, const InertialInput& input,
               const Eigen::Vector3d& gravity_W, double dt);

}  // namespace fiducap::robocentric
