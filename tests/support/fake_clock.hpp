#pragma once

#include <atomic>

#include "base/time.hpp"

namespace fiducap {

/// Only the test moves its time; a wait sets it to the end of the wait.
class FakeClock final : public Clock {
 public:
  explicit FakeClock(Instant start = instant_from_ns(0)) : ns_(to_ns(start)) {}
  [[nodiscard]] Instant now() const override { return instant_from_ns(ns_.load()); }
  [[nodiscard]] bool wait_until(Instant at, std::stop_token stop) const override {
    if (stop.stop_requested()) return false;
    if (to_ns(at) > ns_.load()) ns_.store(to_ns(at));
    return true;
  }
  void advance(Duration d) { ns_ += d.count(); }

 private:
  mutable std::atomic<std::int64_t> ns_;
};

}  // namespace fiducap
