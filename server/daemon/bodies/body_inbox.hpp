#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <stop_token>
#include <vector>

#include "base/time.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// A sample on its way to the worker.
struct Delivery {
  SensorSample sample;
  Instant arrived{};  ///< Server time.
};

/// Between a body's reader and its worker, in order of arrival. Bounded: the oldest image goes when
/// images pile up, an IMU reading never goes (full means that the worker is dead). The lock is held
/// for a push or a swap only.
class BodyInbox final {
 public:
  static constexpr std::size_t kMaxImu = 4096;

  /// @param max_images  more of them waiting: the oldest goes
  explicit BodyInbox(std::size_t max_images);

  /// @return false when the inbox is closed or full of IMU readings.
  bool push(SensorSample sample, Instant arrived);
  /// Nothing more will come; what is there can still be taken.
  void finish();
  /// Nothing will be taken any more.
  void close();
  /// Waits for samples and swaps them into `out`, which is emptied first.
  /// @return false when exhausted, closed or stopped
  [[nodiscard]] bool take(std::vector<Delivery>& out, std::stop_token stop);
  [[nodiscard]] std::uint64_t images_dropped() const;

 private:
  mutable std::mutex mutex_;
  std::condition_variable_any filled_;
  std::vector<Delivery> waiting_;
  std::size_t max_images_;
  std::size_t images_{0};
  std::uint64_t images_dropped_{0};
  bool finished_{false};
  bool closed_{false};
};

}  // namespace fiducap
