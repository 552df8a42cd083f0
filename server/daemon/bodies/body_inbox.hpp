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

/// Between a body's readers and its worker, in order of arrival. Bounded: the oldest image goes
/// when images pile up; a single IMU reading never goes. When so many of them wait that they are
/// seconds old, all that waits goes at once: the body begins anew with the present. The lock is
/// held for a push or a swap only.
class BodyInbox final {
 public:
  static constexpr std::size_t kMaxImu = 4096;

  /// @param max_images  more of them waiting: the oldest goes
  explicit BodyInbox(std::size_t max_images);

  /// @return false when the inbox is closed or finished
  bool push(SensorSample sample, Instant arrived);
  /// Nothing more will come; what is there can still be taken.
  void finish();
  /// Nothing will be taken any more.
  void close();
  /// Lets take() return once, also without samples.
  void wake();
  /// Waits for samples and swaps them into `out`, which is emptied first.
  /// @return false when exhausted, closed or stopped
  [[nodiscard]] bool take(std::vector<Delivery>& out, std::stop_token stop);
  /// Forgets what waits.
  void clear();
  /// How often everything went because IMU readings piled up.
  [[nodiscard]] std::uint64_t overflows() const;
  [[nodiscard]] std::uint64_t images_dropped() const;

 private:
  mutable std::mutex mutex_;
  std::condition_variable_any filled_;
  std::vector<Delivery> waiting_;
  std::size_t max_images_;
  std::size_t images_{0};
  std::uint64_t images_dropped_{0};
  std::uint64_t overflows_{0};
  bool finished_{false};
  bool woken_{false};
  bool closed_{false};
};

}  // namespace fiducap
