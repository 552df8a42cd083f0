#pragma once

#include <functional>

#include "base/expected.hpp"

namespace fiducap {

/// Where a cost is smallest.
struct ShiftResult {
  double shift_s{};
  double sigma_s{};       ///< From the curvature: the cost is a chi-square.
  bool at_border{false};  ///< The true minimum lies outside the range.
  bool determined{true};  ///< False: the cost hardly depends on the shift; `shift_s` is 0 then.
  int evaluations{};
};

/// Chi-square of the recording when its images are this many seconds later.
using ShiftCost = std::function<Expected<double>(double shift_s)>;

/// Minimum in ±range_s: a coarse grid, a golden section in its best cell, a parabola through the
/// neighbourhood (a filter's cost is a little jagged, a section alone would end in one of its
/// teeth).
/// @return Error of the first cost that fails
[[nodiscard]] Expected<ShiftResult> search_time_shift(const ShiftCost& cost, double range_s);

}  // namespace fiducap
