#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "base/time.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

struct MergerConfig {
  bool has_imu{true};
  Duration window{std::chrono::milliseconds(250)};  ///< An image waits at most this long (in sample time) for its IMU samples.
  std::size_t max_images{8};                        ///< More images than this waiting: the oldest goes.
  std::size_t max_imu{4096};                        ///< More IMU samples than this waiting: the body is lost.
};

/// Counts of what did not pass; never reset.
struct MergerStatistics {
  std::uint64_t images_dropped{};    ///< Queue full, the oldest went.
  std::uint64_t late_dropped{};      ///< Older than what was already released.
  std::uint64_t backwards_dropped{}; ///< Time of one sensor did not increase.
  std::uint64_t bad_dropped{};       ///< NaN or infinite numbers.
  std::uint64_t imu_waits_expired{}; ///< Image released without the IMU sample that closes its interval.
};

/// Puts the samples of one body's sensors into the order in which the filter wants them.
///
/// Order given out: IMU samples by time; an image exposed at t comes right *after the first* IMU sample at or after t,
/// so that the filter can interpolate up to t and never has to guess. Without IMU: images by time.
/// Equal images of several cameras: by camera index. Not thread-safe; app/ guards it.
class SampleMerger final {
 public:
  explicit SampleMerger(const MergerConfig& config);
  /// In order of arrival. Bad, backward and late samples are counted and dropped.
  /// @return false when the IMU queue is full: the consumer is dead.
  bool push(SensorSample sample);
  /// Nothing more will come: `pop` gives the rest without waiting.
  void finish();
  /// @return nullopt when the next sample must still wait.
  [[nodiscard]] std::optional<SensorSample> pop();
  [[nodiscard]] const MergerStatistics& statistics() const { return statistics_; }

 private:
  MergerConfig config_;
  MergerStatistics statistics_;
  std::deque<ImuSample> imu_;
  std::deque<SensorSample> images_;
  std::optional<Instant> released_imu_;
  std::optional<Instant> newest_imu_;
  std::optional<Instant> newest_seen_;
  bool finished_{false};
};

}  // namespace fiducap
