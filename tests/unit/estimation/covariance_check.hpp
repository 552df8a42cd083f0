#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>

#include "estimation/imu/imu_buffer.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {

// First order covariances against central differences of the means, relative to the largest number.
inline constexpr double kFirstOrder = 1e-6;

template <class State>
State with_error(const State& state, const Eigen::VectorXd& error) {
  State out = state;
  out.add_error(error);
  return out;
}

/// Jacobian of a change of the mean, in error coordinates before and after.
template <class State>
Eigen::MatrixXd jacobian_of(const std::function<void(State&)>& change, const State& before) {
  State after = before;
  change(after);
  return central_differences(
      [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        State other = with_error(before, d);
        change(other);
        return after.error_to(other);
      },
      before.size());
}

/// Checks that `change` transforms P with the Jacobian of its own mean and adds this noise.
template <class State>
void expect_covariance_follows_mean(const State& before, const std::function<void(State&)>& change,
                                    const Eigen::MatrixXd& added_noise = {}) {
  State after = before;
  change(after);
  Eigen::MatrixXd expected = propagated(jacobian_of(change, before), before.P());
  if (added_noise.size() > 0) expected += added_noise;
  const Eigen::MatrixXd got = after.P();
  expect_matrices_near(got, expected, kFirstOrder);
  expect_matrices_near(got, got.transpose(), 1e-12);
}

/// Covariance of numbers of a state, by differences: f(error) is the error of the numbers.
template <class State>
Eigen::MatrixXd covariance_of(const State& state,
                              const std::function<Eigen::VectorXd(const State&)>& error) {
  return propagated(
      central_differences([&](const auto& d) { return error(with_error(state, d)); }, state.size()),
      state.P());
}

/// Rotation and force in all axes.
inline InertialInput example_input(bool has_accelerometer) {
  InertialInput input;
  input.w_B = {0.8, -1.2, 0.5};
  input.f_B = {1.0, -2.0, 9.0};
  input.has_accelerometer = has_accelerometer;
  return input;
}

}  // namespace fiducap
