#pragma once

#include <condition_variable>

#include "base/clock.hpp"

namespace fiducap {

/// The real time: CLOCK_MONOTONIC. One for the whole process; any thread may wait on it.
class SystemClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const override;
  [[nodiscard]] bool wait_until(Instant at, std::stop_token stop) const override;

 private:
  mutable std::condition_variable_any never_;  // only a stop request wakes a wait early
};

/// UTC = server time + this. Measured now; it moves when the wall clock is corrected.
[[nodiscard]] Duration utc_offset();
[[nodiscard]] std::int64_t utc_now_ns();

}  // namespace fiducap
