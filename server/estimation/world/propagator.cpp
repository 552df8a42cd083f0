#include "estimation/world/propagator.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/filter/filter_rules.hpp"

namespace fiducap::world {

using namespace layout;        // NOLINT: block names
using namespace filter_rules;  // NOLINT: short names

Propagator::Propagator(const BodySensors& sensors, const EstimatorConfig& config)
    : sensors_(sensors),
      config_(config),
      gravity_W_(0, 0, -sensors.gravity_m_s2),
      imu_(sensors.imu.value_or(ImuNoise{}), config.max_imu_gap_s, config.motion_accel_m_s2_rtHz) {}

void Propagator::integrate(FilterState& state, Instant to, double variance, JumpSearch& path) {
  if (!sensors_.imu)
    return step_to(state, to, motion_without_imu(config_), kStepWithoutImu_s, variance, path);
  while (state.time < to) {
    const Instant end = imu_.end_of_interval(state.time, to);
    step_to(state, end, imu_.input_between(state.time, end), kStepWithImu_s, variance, path);
  }
}

void Propagator::step_to(FilterState& state, Instant to, InertialInput input, double longest_s,
                         double variance, JumpSearch& path) {
  input.scale_noise(std::sqrt(variance));
  while (state.time < to) {
    const Instant end = std::min(to, state.time + from_seconds(longest_s));
    propagate(state, motion_, input, gravity_W_, to_seconds(end - state.time));
    state.time = end;
    if (sensors_.imu) path.note_motion(end, state.X_WB);
  }
}

void Propagator::aim(FilterState& state, const Pose& X_B0B, double dt) {
  before_ = state;
  aimed_off_.setZero();
  const Eigen::Vector3d v_found = state.X_WB.q * X_B0B.p / dt;
  const Eigen::Vector3d bias_found = -log_so3(X_B0B.q) / dt;
  aimed_off_.segment<3>(kVelocity) = state.v_WB - v_found;
  aimed_off_.segment<3>(kBiasW) = state.bias_w - bias_found;
  state.v_WB = v_found;
  state.bias_w = bias_found;
}

void Propagator::finish_aimed(FilterState& state) {
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(state.size());
  moved.head<kBodySize>() = motion_.Phi * aimed_off_;
  for (int c = 0; c < state.cameras(); ++c)
    moved.segment<6>(layout::camera(c)) = moved.segment<6>(kPosition);
  apply(state, motion_);
  linearisation_ = state;
  state.add_error(moved);
}

}  // namespace fiducap::world
