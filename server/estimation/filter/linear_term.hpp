#pragma once

#include <span>

#include <Eigen/Core>

#include "estimation/filter/growing_covariance.hpp"

namespace fiducap {

/// Part of a linear rule: six numbers depend on the three-wide block at `at`.
struct LinearTerm {
  int at{};
  Eigen::Matrix<double, 6, 3> J;
};

[[nodiscard]] inline LinearTerm linear_term(int at, const Eigen::Matrix3d& to_first,
                                            const Eigen::Matrix3d& to_second) {
  LinearTerm out{at, {}};
  out.J << to_first, to_second;
  return out;
}

/// Replaces two three-wide blocks of the state by a linear function of the present state plus
/// independent noise: (x_first, x_second) ← Σ J x_at + n. Everything else stays; the covariance
/// follows exactly.
void redefine(GrowingCovariance& covariance, int first, int second,
              std::span<const LinearTerm> terms, const Matrix6d& noise);

}  // namespace fiducap
