#pragma once

#include <optional>

#include "estimation/body_filter.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/start/jump_search.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

using MotionParameterMatrix = Eigen::Matrix<double, layout::kBiasF, layout::kMotionSize>;

/// Motion of the body between two images, accumulated over the integration steps. Tags are fixed in
/// W, so a step costs the same for any number of tags, and the full covariance is propagated once
/// per image.
struct MotionSinceImage {
  bool begun{false};
  double seconds{0};
  Pose X_WB_before;                        ///< At the last image.
  BodyMatrix Phi{BodyMatrix::Identity()};  ///< ∂ body now / ∂ body at the last image.
  BodyMatrix Q{BodyMatrix::Zero()};        ///< Covariance of the added noise.
  /// ∂ (position, attitude, velocity) now / ∂ (gravity, errors of the IMU), as in `layout`.
  MotionParameterMatrix by_parameters{MotionParameterMatrix::Zero()};

  void restart() { *this = MotionSinceImage{}; }
};

/// Jacobian and noise of one integration step.
struct StepJacobians {
  BodyMatrix F{BodyMatrix::Identity()};
  /// Of white noise of gyroscope and accelerometer, held over the step.
  Eigen::Matrix<double, layout::kBodySize, 3> G_w{};
  Eigen::Matrix<double, layout::kBodySize, 3> G_f{};
  MotionParameterMatrix by_parameters{MotionParameterMatrix::Zero()};
};

using BodyColumns = Eigen::Matrix<double, Eigen::Dynamic, layout::kBodySize>;
/// M ← M Fᵀ, in place. F has the sparsity of step_mean() or of a product of its results.
void move_columns(const BodyMatrix& F, Eigen::Ref<BodyColumns> M);
/// M ← F M Fᵀ of a symmetric M.
void move_both_ways(const BodyMatrix& F, BodyMatrix& M);

/// Moves the body's mean over dt: exact rotation, force rotated by half of it.
/// @param gravity_W  e.g. (0, 0, -9.81)
StepJacobians step_mean(MovingBody& state, const InertialInput& input,
                        const Eigen::Vector3d& gravity_W, double dt);

/// One integration step: mean, Φ and Q.
void propagate(MovingBody& state, MotionSinceImage& motion, const InertialInput& input,
               const Eigen::Vector3d& gravity_W, double dt);

/// Propagates the covariance by the motion, which is restarted.
void apply(FilterState& state, MotionSinceImage& motion);

/// Propagates a state from image to image: by the IMU's samples or, without IMU, by white noise
/// acceleration and angular acceleration, linearised at the motion shown by the tags of each image.
class Propagator final {
 public:
  /// Keeps references to both.
  Propagator(const BodySensors& sensors, const EstimatorConfig& config);

  [[nodiscard]] ImuBuffer& imu() { return imu_; }
  [[nodiscard]] const ImuBuffer& imu() const { return imu_; }
  /// Since the last image.
  [[nodiscard]] const MotionSinceImage& motion() const { return motion_; }
  void restart() { motion_.restart(); }

  /// Moves the mean. @param variance  factor of the IMU's configured ones
  void integrate(FilterState& state, Instant to, double variance, JumpSearch& path);
  /// Propagates the covariance over the steps since the last image.
  void finish(FilterState& state) { apply(state, motion_); }

  /// Without IMU: linearises the motion at the velocity and rate that lead to X_B0B in dt.
  void aim(FilterState& state, const Pose& X_B0B, double dt);
  /// After the steps: propagates the covariance and restores the prior mean.
  void finish_aimed(FilterState& state);
  /// Linearisation point of the present image; nullptr: the mean.
  [[nodiscard]] FilterState* linearisation() { return linearisation_ ? &*linearisation_ : nullptr; }
  void forget_aim() { linearisation_.reset(); }
  /// Restores the state before aim().
  void take_back(FilterState& state) const { state = before_; }

 private:
  void step_to(FilterState& state, Instant to, InertialInput input, double longest_s,
               double variance, JumpSearch& path);

  const BodySensors& sensors_;
  const EstimatorConfig& config_;
  Eigen::Vector3d gravity_W_;
  ImuBuffer imu_;
  MotionSinceImage motion_;
  FilterState before_;
  std::optional<FilterState> linearisation_;
  Eigen::Matrix<double, layout::kBodySize, 1> aimed_off_;
};

}  // namespace fiducap::world
