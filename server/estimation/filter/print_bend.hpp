#pragma once

#include <Eigen/Core>

#include "base/so3.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// How unsure a body's pose is because paper bends: the print that says where W is lies 0.17°
/// (1-sigma per axis) off the plane that it is taken for, as one of 0.16 m with a bow of 0.25 mm
/// does, and the room turns about it.
/// @param p_TB_W  from the print to the body, W axes, m
/// @return covariance of (position, m; rotation vector, rad), both W axes
[[nodiscard]] inline Matrix6d bend_of_print(const Eigen::Vector3d& p_TB_W) {
  constexpr double kBend_rad = 3e-3;
  Eigen::Matrix<double, 6, 3> turn;
  turn << -skew(p_TB_W), Eigen::Matrix3d::Identity();
  return kBend_rad * kBend_rad * turn * turn.transpose();
}

}  // namespace fiducap
