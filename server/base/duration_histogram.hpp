#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "base/time.hpp"

namespace fiducap {

/// Counts durations in bins that grow by 3 %, from 1 µs to about half an hour: quantiles of a
/// stream in 6 kB.
class DurationHistogram final {
 public:
  void add(Duration duration) {
    const double steps =
        std::log(std::max(1.0, to_seconds(duration) / kSmallest_s)) / std::log(kGrowth);
    ++bins_[std::min(bins_.size() - 1, static_cast<std::size_t>(steps))];
    ++count_;
  }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// Upper end of the bin that holds this share of all; 0 when there is none. @pre 0 <= share <= 1
  [[nodiscard]] Duration quantile(double share) const {
    if (count_ == 0) return Duration{0};
    const double wanted = share * static_cast<double>(count_);
    double below = 0;
    std::size_t bin = 0;
    while (bin + 1 < bins_.size() && below + static_cast<double>(bins_[bin]) < wanted) {
      below += static_cast<double>(bins_[bin++]);
    }
    return from_seconds(kSmallest_s * std::pow(kGrowth, static_cast<double>(bin) + 1));
  }

 private:
  static constexpr double kSmallest_s = 1e-6;
  static constexpr double kGrowth = 1.03;
  std::array<std::uint64_t, 720> bins_{};
  std::uint64_t count_{0};
};

}  // namespace fiducap
