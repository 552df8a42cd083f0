#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace fiducap {

/// The value below which `share` of the values lie (linear between neighbours); 0 when empty.
[[nodiscard]] inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  const double part = place - static_cast<double>(below);
  return (1 - part) * values[below] + part * values[above];
}

}  // namespace fiducap
