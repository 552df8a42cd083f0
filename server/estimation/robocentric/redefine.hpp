#pragma once

#include <span>

#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

/// Part of a linear rule: six numbers depend on the three-wide block at `at`.
struct LinearTerm {
  int at{};
  Eigen::Matrix<double, 6, 3> J;
};

/// Replaces two three-wide blocks of the state by a linear function of the present state plus independent noise:
/// (x_first, x_second) ← Σ J x_at + n. Everything else stays; the covariance follows exactly.
void redefine(FilterState& state, int first, int second, std::span<const LinearTerm> terms, const Matrix6d& noise);

}  // namespace fiducap::robocentric
