#pragma once

#include <optional>

#include "estimation/body_filter.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/update/jump_search.hpp"
#include "estimation/world/propagation.hpp"

namespace fiducap::world {

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
