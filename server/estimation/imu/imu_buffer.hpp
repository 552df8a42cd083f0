#pragma once

#include <optional>
#include <vector>

#include "capture/imu_sample.hpp"
#include "estimation/imu/inertial_input.hpp"
#include "estimation/imu/saturation_watch.hpp"

namespace fiducap {

/// Nothing in a filter looks back further than this, and readings are kept for so long at least.
inline constexpr Duration kFilterPast = std::chrono::seconds(3);

/// The readings since the oldest instant that somebody still needs, and what they say about any
/// moment between them. Bounded; allocates nothing after construction.
class ImuBuffer final {
 public:
  /// @param max_gap_s         longer holes count as a gap
  /// @param gap_accel_noise   acceleration density that bridges a gap, m/s²/√Hz
  ImuBuffer(const ImuNoise& noise, double max_gap_s, double gap_accel_noise);

  /// @return false for a reading that is not newer than the last one, or not finite: it is left
  /// out.
  bool push(const ImuSample& imu);
  [[nodiscard]] std::optional<ImuSample> newest() const;
  /// The newest rate is at the end of the gyro's range.
  [[nodiscard]] bool is_gyro_blind() const {
    return !samples_.empty() && samples_.back().saturated.gyro;
  }
  /// @pre at least two readings
  [[nodiscard]] const ImuSample& before_newest() const { return samples_[samples_.size() - 2].imu; }
  /// So many readings that somebody must use them: more than kFilterPast of them at the unit's
  /// rate. One more makes the oldest go.
  [[nodiscard]] bool is_full() const;
  /// Older readings may come again.
  void forget_all() {
    samples_.clear();
    watch_ = SaturationWatch(noise_);
  }
  /// Forgets all but the last two.
  void keep_newest_pair();
  /// Forgets what no interval after `at` needs; the last reading at or before `at` opens the next
  /// interval and stays.
  void forget_before(Instant at);

  /// The end of the interval between two readings that `from` lies in, at most `to`; `to` beyond
  /// the newest reading.
  [[nodiscard]] Instant end_of_interval(Instant from, Instant to) const;
  /// Force and rate halfway between `from` and `to`, linear between the readings around, held
  /// beyond the newest and before the oldest: when that is further than `max_gap_s`, with the noise
  /// of a gap.
  /// @pre both in one interval
  [[nodiscard]] InertialInput input_between(Instant from, Instant to) const;

 private:
  /// Index of the first reading after `at`, or the number of readings.
  [[nodiscard]] std::size_t first_after(Instant at) const;

  ImuNoise noise_;
  std::size_t most_;
  double max_gap_s_;
  double gap_accel_noise_;
  SaturationWatch watch_;
  std::vector<JudgedReading> samples_;
};

}  // namespace fiducap
