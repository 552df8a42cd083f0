#pragma once

#include <chrono>
#include <thread>

#include "base/time.hpp"

namespace fiducap {

/// The machine's monotonic clock, as in the server.
class RealClock : public Clock {
 public:
  [[nodiscard]] Instant now() const override {
    return Instant{std::chrono::steady_clock::now().time_since_epoch()};
  }
  [[nodiscard]] bool wait_until(Instant at, std::stop_token stop) const override {
    std::this_thread::sleep_for(at - now());
    return !stop.stop_requested();
  }
};

/// For sources that wait on descriptors or the middleware.
class SteadyClock final : public RealClock {
 public:
  [[nodiscard]] bool wait_until(Instant, std::stop_token) const override { return false; }
};

}  // namespace fiducap
