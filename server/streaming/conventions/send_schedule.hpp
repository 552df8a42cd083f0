#pragma once

#include <optional>

#include "base/time.hpp"

namespace fiducap {

/// Which frames of a faster stream are sent on at a lower rate: evenly, in the mean exactly at that
/// rate.
class SendSchedule final {
 public:
  explicit SendSchedule(double rate_hz) : period_(from_seconds(1.0 / rate_hz)) {}

  /// @return this frame is due. Half a frame early counts: frames come at their own times.
  bool is_due(Instant at, double frame_rate_hz) {
    const Duration early = frame_rate_hz > 0 ? from_seconds(0.5 / frame_rate_hz) : Duration{0};
    if (next_ && at + early < *next_) return false;
    // After a gap, or with frames too slow for the rate, it starts again from now.
    next_ = next_ && at - *next_ < period_ ? *next_ + period_ : at + period_;
    return true;
  }

 private:
  Duration period_;
  std::optional<Instant> next_;
};

}  // namespace fiducap
