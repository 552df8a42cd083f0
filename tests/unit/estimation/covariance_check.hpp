#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>

#include "base/pose.hpp"
#include "estimation/filter/heading_rule.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/known_tag.hpp"
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

/// Anchoring to a tag: the covariance follows, the tag is where the gauge has it, up stays up, and
/// a second time nothing changes.
template <class State>
void expect_anchoring(const State& example, const std::function<Pose(const State&)>& X_WB) {
  for (const bool level : {true, false}) {
    HeadingRule rule;
    rule.axis = 1;
    rule.yaw_rad = 0.3;
    rule.X_WT = {exp_so3({0.2, 0.1, -0.4}), {3, -2, 1}};
    expect_covariance_follows_mean<State>(
        example, [&](State& state) { anchor_to_reference(state, 1, rule, level); });
  }
  State state = example;
  const auto up = [&] { return (X_WB(state).q.conjugate() * Eigen::Vector3d::UnitZ()).z(); };
  const double up_before = up();
  WorkspaceGauge gauge;
  gauge.X_WT = Pose{exp_so3({1.2, 0.1, -0.4}), {3, -2, 1}};
  const HeadingRule rule = make_heading_rule(gauge, X_WB(state).q);
  const Pose before = X_WB(state);
  const Pose shift = anchor_to_reference(state, 2, rule, true);
  const KnownTag tag = tag_in_workspace(state, 2);
  EXPECT_LT((tag.X_WT.p - gauge.X_WT->p).norm(), 1e-9);
  EXPECT_LT(log_so3(turn_to_heading(rule, tag.X_WT.q)).norm(), 1e-9);
  EXPECT_NEAR(up(), up_before, 1e-9) << "up must stay up";
  EXPECT_LT(tag.covariance.topLeftCorner(3, 3).cwiseAbs().maxCoeff(), 1e-9) << "by definition";
  EXPECT_LT(((shift * before).p - X_WB(state).p).norm(), 1e-9);

  State once = example;
  const HeadingRule own = make_heading_rule({}, X_WB(once).q);
  anchor_to_reference(once, 0, own, true);
  State again = once;
  anchor_to_reference(again, 0, own, true);
  EXPECT_LT(once.error_to(again).norm(), 1e-9);
  EXPECT_LT((once.P() - again.P()).cwiseAbs().maxCoeff(), 1e-9);
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
