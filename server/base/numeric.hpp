#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "base/time.hpp"

namespace fiducap {

inline constexpr double kDegree = std::numbers::pi / 180;
inline constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

/// The value below which `share` of the values lie, linear between neighbours; 0 when empty.
[[nodiscard]] inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  const double part = place - static_cast<double>(below);
  return (1 - part) * values[below] + part * values[above];
}

/// The n-th smallest value, counted from 0. Reorders them. @pre n < values.size()
[[nodiscard]] inline double nth_smallest(std::span<double> values, std::size_t n) {
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(n);
  std::ranges::nth_element(values, nth);
  return *nth;
}

/// At most `most` of them, evenly chosen.
template <typename T>
[[nodiscard]] std::vector<T> thinned(const std::vector<T>& all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<T> some;
  for (std::size_t i = 0; i < most; ++i) some.push_back(all[i * all.size() / most]);
  return some;
}

/// Quantiles of a stream of durations in 6 kB: bins grow by 3 %, from 1 µs to about half an hour.
class DurationHistogram final {
 public:
  void add(Duration duration) {
    const double steps =
        std::log(std::max(1.0, to_seconds(duration) / kSmallest_s)) / std::log(kGrowth);
    ++bins_[std::min(bins_.size() - 1, static_cast<std::size_t>(steps))];
    ++count_;
  }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// Upper end of the bin with this quantile; 0 when nothing was added. @pre 0 <= share <= 1
  [[nodiscard]] Duration quantile(double share) const {
    if (count_ == 0) return Duration{0};
    const double wanted = share * static_cast<double>(count_);
    double below = 0;
    std::size_t bin = 0;
    while (bin + 1 < bins_.size() && below + static_cast<double>(bins_[bin]) < wanted)
      below += static_cast<double>(bins_[bin++]);
    return from_seconds(kSmallest_s * std::pow(kGrowth, static_cast<double>(bin) + 1));
  }

 private:
  static constexpr double kSmallest_s = 1e-6;
  static constexpr double kGrowth = 1.03;
  std::array<std::uint64_t, 720> bins_{};
  std::uint64_t count_{0};
};

/// Minimum of the parabola through three values: steps from the middle one, in [-1, 1]; 0: none.
[[nodiscard]] inline double minimum_of_parabola(double before, double middle, double after) {
  const double curvature = before - 2 * middle + after;
  return curvature > 0 ? std::clamp(0.5 * (before - after) / curvature, -1.0, 1.0) : 0.0;
}

}  // namespace fiducap
