#pragma once

#include <random>

#include <Eigen/Core>

#include "estimation/robocentric/filter_state.hpp"
#include "example_tags.hpp"

namespace fiducap::robocentric {

/// A body with two cameras and three tags in front of camera 0, nothing aligned with anything.
inline FilterState example_state() {
  FilterState state;
  state.p_WB_B = {1.2, -0.7, 0.9};
  state.v_WB_B = {0.5, 0.3, -0.4};
  state.q_WB = exp_so3({0.4, -0.6, 1.1});
  state.bias_f = {0.05, -0.04, 0.06};
  state.bias_w = {0.006, -0.004, 0.005};
  state.X_BV = {{exp_so3({0.1, -1.5, 0.2}), {0.05, -0.02, 0.03}},
                {exp_so3({0.15, -1.45, 0.1}), {0.06, 0.11, 0.02}}};
  state.resize_covariance();
  std::mt19937 random(7);
  std::normal_distribution<double> gauss;
  const auto positive = [&](int n) {
    Eigen::MatrixXd A(n, n);
    for (int i = 0; i < n * n; ++i) A(i) = gauss(random);
    return Eigen::MatrixXd(0.01 * A * A.transpose());
  };
  for (int i = 0; i < 3; ++i) {
    LocalTag tag;
    tag.tag_id = 10 + i;
    tag.edge_m = 0.2;
    tag.X_VT = {exp_so3({3.0 + 0.1 * i, 0.2 - 0.3 * i, 0.4}),
                {-0.3 + 0.3 * i, 0.1 * i, 1.5 + 0.4 * i}};
    state.add_tag(tag, Matrix6d::Identity());
  }
  state.P() = positive(state.size());
  return state;
}

}  // namespace fiducap::robocentric
