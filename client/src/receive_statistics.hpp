#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "src/messages.hpp"

namespace fiducap::sdk {

/// Rate and latency of the last frames. Fixed memory, not thread-safe; a copy is a snapshot.
class ReceiveStatistics {
 public:
  /// @param latency_s  instant of the pose → arrival; NaN while the clock offset is unknown
  void add(Nanoseconds received, double latency_s);
  /// Number of frames in the second before `now`.
  double rate_hz(Nanoseconds now) const;
  /// Quantile of the last 1000 latencies. @param share  e.g. 0.99  @return NaN without any
  double latency_quantile_s(double share) const;
  /// NaN without any.
  double latency_max_s() const { return latency_quantile_s(1.0); }

 private:
  static constexpr std::size_t kKept = 1000;
  struct Arrival {
    Nanoseconds received{0};
    double latency_s{0};
  };
  std::array<Arrival, kKept> arrivals_{};
  std::size_t next_{0};
  std::size_t count_{0};
};

}  // namespace fiducap::sdk
