#pragma once

#include <Eigen/Core>

#include "base/pose.hpp"

namespace fiducap {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A tag whose place in the workspace is an input of the filter, not its state (RCARS II-D4, last
/// paragraph).
struct KnownTag {
  int tag_id{};
  double edge_m{};
  Pose X_WT;
  /// Position (m, W axes) then attitude (rotation vector in W axes, q_WT = exp(δ) q̂_WT). Zero:
  /// exact.
  Matrix6d covariance{Matrix6d::Zero()};

  [[nodiscard]] bool is_exact() const { return covariance.isZero(0); }
};

}  // namespace fiducap
