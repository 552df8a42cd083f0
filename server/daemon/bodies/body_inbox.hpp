#pragma once

#include <array>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <stop_token>

#include "capture/sample_merger.hpp"

namespace fiducap {

/// A sample on its way to the worker.
struct Delivery {
  SensorSample sample;
  Instant arrived{};  ///< Server time; unknown (equal to the sample's time) for IMU readings.
};

/// Between a body's reader and its worker: SampleMerger with a lock around it. Bounded: the oldest
/// image goes when images pile up, an IMU reading never goes (full means that the worker is dead).
/// The lock is held for a push or a pop only, never while somebody computes.
class BodyInbox final {
 public:
  explicit BodyInbox(const MergerConfig& config) : merger_(config) {}

  /// @return false when the inbox is closed or full of IMU readings.
  bool push(SensorSample sample, Instant arrived);
  /// See SampleMerger.
  void set_clock_shift(int camera, Duration shift);
  /// Nothing more will come; what is there can still be popped.
  void finish();
  /// Nobody will pop any more.
  void close();
  /// Waits for the next sample in the order of SampleMerger. @return nullopt when exhausted, closed
  /// or stopped.
  [[nodiscard]] std::optional<Delivery> pop(std::stop_token stop);
  [[nodiscard]] MergerStatistics statistics() const;

 private:
  struct Arrival {
    Instant stamp{};  ///< of the device
    Instant arrived{};
  };
  [[nodiscard]] Instant arrival_of(const SensorSample& sample) const;

  mutable std::mutex mutex_;
  std::condition_variable_any filled_;
  SampleMerger merger_;
  std::array<Arrival, 64> arrivals_{};  // of the newest images; the merger keeps far fewer
  std::size_t next_arrival_{0};
  bool finished_{false};
  bool closed_{false};
};

}  // namespace fiducap
