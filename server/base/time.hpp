#pragma once

#include <chrono>
#include <cstdint>
#include <stop_token>

namespace fiducap {

/// A span of time, int64 nanoseconds. Never a double.
using Duration = std::chrono::nanoseconds;

/// Monotonic time line of the server and its live sensors; a recording has its own epoch.
struct ServerTimeline {
  using rep = std::int64_t;
  using period = std::nano;
  using duration = Duration;
  using time_point = std::chrono::time_point<ServerTimeline, Duration>;
  static constexpr bool is_steady = true;
};

/// A point on the server's time line, int64 nanoseconds.
using Instant = ServerTimeline::time_point;

[[nodiscard]] constexpr Instant instant_from_ns(std::int64_t ns) { return Instant{Duration{ns}}; }
[[nodiscard]] constexpr std::int64_t to_ns(Instant at) { return at.time_since_epoch().count(); }

/// Seconds as a double, for formulas only.
[[nodiscard]] constexpr double to_seconds(Duration d) {
  return static_cast<double>(d.count()) * 1e-9;
}
/// Rounds to the nearest nanosecond.
[[nodiscard]] constexpr Duration from_seconds(double s) {
  return Duration{static_cast<std::int64_t>(s * 1e9 + (s < 0 ? -0.5 : 0.5))};
}

/// The only source of the current time. The daemon has the real one; tests use a `FakeClock`.
class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual Instant now() const = 0;
  /// Sleeps until `at`; returns at once when it has passed.
  /// @return false when `stop` came first
  [[nodiscard]] virtual bool wait_until(Instant at, std::stop_token stop) const = 0;
};

}  // namespace fiducap
