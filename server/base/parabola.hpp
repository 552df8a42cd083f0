#pragma once

#include <algorithm>

namespace fiducap {

/// Where the parabola through three values, a step apart, has its lowest point: steps from the
/// middle one, at most one; 0 when they bend the other way.
[[nodiscard]] inline double lowest_of_parabola(double before, double middle, double after) {
  const double bend = before - 2 * middle + after;
  return bend > 0 ? std::clamp(0.5 * (before - after) / bend, -1.0, 1.0) : 0.0;
}

}  // namespace fiducap
