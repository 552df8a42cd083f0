#pragma once

#include <stop_token>

#include "base/time.hpp"

namespace fiducap {

/// The only way a room learns what time it is. The real one lives in `daemon/`, tests drive a
/// `FakeClock`.
class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual Instant now() const = 0;
  /// Sleeps until `at` (returns at once when it has passed).
  /// @return false when `stop` came first.
  [[nodiscard]] virtual bool wait_until(Instant at, std::stop_token stop) const = 0;
};

}  // namespace fiducap
