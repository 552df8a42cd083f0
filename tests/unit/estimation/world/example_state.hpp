#pragma once

#include <random>

#include "base/pose.hpp"
#include "estimation/world/filter_state.hpp"
#include "example_tags.hpp"

namespace fiducap::world {

/// A body with two cameras, three clones and three tags in front of camera 0, far from the origin,
/// nothing aligned with anything. Camera 0 is at its image; camera 1 has a rolling shutter and
/// a clock that is off. Lenses and prints are doubted, two prints are watched.
inline FilterState example_state() {
  FilterState state;
  state.reset({{exp_so3({0.1, -1.5, 0.2}), {0.05, -0.02, 0.03}},
               {exp_so3({0.15, -1.45, 0.1}), {0.06, 0.11, 0.02}}},
              3);
  state.X_WB = {exp_so3({0.4, -0.6, 1.1}), {4.2, -3.7, 0.9}};
  state.v_WB = {0.5, 0.3, -0.4};
  state.bias_f = {0.05, -0.04, 0.06};
  state.bias_w = {0.006, -0.004, 0.005};
  for (int i = 0; i < 3; ++i) {
    WorldTag tag;
    tag.tag_id = 10 + i;
    tag.edge_m = 0.2;
    tag.X_WT = state.X_WB * state.X_BV[0] *
               Pose{exp_so3({3.0 + 0.1 * i, 0.2 - 0.3 * i, 0.4}),
                    {-0.3 + 0.3 * i, 0.1 * i, 1.5 + 0.4 * i}};
    state.add_tag(tag, Matrix6d::Identity());
  }
  for (int i = 0; i < 3; ++i) {
    state.clones[static_cast<std::size_t>(i)].X_WV = {exp_so3({0.2 * i, -1.1, 0.3}),
                                                      {4.0 - 0.2 * i, -3.5 + 0.1 * i, 0.8}};
  }
  std::mt19937 random(7);
  std::normal_distribution<double> gauss;
  Eigen::MatrixXd A(state.size(), state.size());
  for (Eigen::Index i = 0; i < A.size(); ++i) A(i) = gauss(random);
  const Eigen::MatrixXd square = A * A.transpose();
  state.P() = 0.005 * (square + square.transpose());  // symmetric to the last bit
  state.gyro_B = {0.8, -1.2, 0.5};
  state.clocks[0] = {.shift_s = 0.013, .readout_s = 0.0, .applied_s = 0.013};
  state.clocks[1] = {
      .shift_s = -0.021, .readout_s = 0.016, .applied_s = -0.024, .rows_apart = true};
  state.sizes.watched[1] = {11, 0.0};
  state.sizes.watched[3] = {12, 0.0};
  state.parameter_tests.resize(1);
  return state;
}

}  // namespace fiducap::world
