#pragma once

#include "estimation/imu/inertial_input.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// What happened to the body between two images, accumulated over the inertial steps. Tags stand
/// still in W and their errors do not enter the motion, so an inertial step costs the same whatever
/// the number of tags, and the map's covariance with the body is moved once per image.
struct MotionSinceImage {
  bool begun{false};
  double seconds{0};
  Pose X_WB_before;                        ///< Where the body was at the last image.
  BodyMatrix Phi{BodyMatrix::Identity()};  ///< ∂ body now / ∂ body at the last image.
  BodyMatrix Q{BodyMatrix::Zero()};        ///< Covariance of what was added on the way.
  /// What gravity does to the body: −∂ z / ∂ gravity and −∂ (velocity along z) / ∂ gravity.
  double fall_s2{0};
  double fall_s{0};

  void restart() { *this = MotionSinceImage{}; }
};

/// Jacobian and noise of one inertial step.
struct StepJacobians {
  BodyMatrix F{BodyMatrix::Identity()};
  Eigen::Matrix<double, layout::kBodySize, 3> G_w{};  ///< of white gyro noise, held over the step
  Eigen::Matrix<double, layout::kBodySize, 3>
      G_f{};  ///< of white accelerometer noise, held over the step
};

using BodyColumns = Eigen::Matrix<double, Eigen::Dynamic, layout::kBodySize>;
/// M ← M Fᵀ, in place: of F, or a product of several, only the blocks that step_mean() fills differ
/// from the identity.
void move_columns(const BodyMatrix& F, Eigen::Ref<BodyColumns> M);
/// M ← F M Fᵀ of a symmetric M.
void move_both_ways(const BodyMatrix& F, BodyMatrix& M);

/// Moves the body's mean over dt under one reading: exact rotation, force turned by half of it.
/// @param gravity_W  e.g. (0, 0, -9.81)
StepJacobians step_mean(FilterState& state, const InertialInput& input,
                        const Eigen::Vector3d& gravity_W, double dt);

/// One inertial step: mean, Φ and Q. The covariance of `state` itself is not touched.
void propagate(FilterState& state, MotionSinceImage& motion, const InertialInput& input,
               const Eigen::Vector3d& gravity_W, double dt);

/// Moves the covariance by the motion, which starts anew.
void apply(FilterState& state, MotionSinceImage& motion);

}  // namespace fiducap::world
