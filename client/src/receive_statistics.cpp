#include "src/receive_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fiducap::sdk {

void ReceiveStatistics::add(Nanoseconds received, double latency_s) {
  arrivals_[next_] = {received, latency_s};
  next_ = (next_ + 1) % kKept;
  count_ = std::min(count_ + 1, kKept);
}

double ReceiveStatistics::rate_hz(Nanoseconds now) const {
  const auto end = arrivals_.begin() + static_cast<std::ptrdiff_t>(count_);
  const auto recent = std::count_if(arrivals_.begin(), end,
                                    [now](const Arrival& a) { return now - a.received < kSecond; });
  if (static_cast<std::size_t>(recent) < kKept) return static_cast<double>(recent);
  // More than kKept frames in this second: from the time they took.
  const Nanoseconds oldest = arrivals_[next_].received;
  return static_cast<double>(kKept) * kSecond /
         static_cast<double>(std::max<Nanoseconds>(1, now - oldest));
}

double ReceiveStatistics::latency_quantile_s(double share) const {
  std::array<double, kKept> sorted{};
  std::size_t n = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    if (std::isfinite(arrivals_[i].latency_s)) sorted[n++] = arrivals_[i].latency_s;
  }
  if (n == 0) return std::numeric_limits<double>::quiet_NaN();
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(n)));
  const std::size_t at = std::min(n, std::max<std::size_t>(rank, 1)) - 1;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(at),
                   sorted.begin() + static_cast<std::ptrdiff_t>(n));
  return sorted[at];
}

}  // namespace fiducap::sdk
