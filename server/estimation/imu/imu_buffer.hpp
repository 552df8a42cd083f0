#pragma once

#include <optional>
#include <vector>

#include "capture/imu_sample.hpp"
#include "estimation/imu/inertial_input.hpp"
#include "estimation/imu/saturation_watch.hpp"

namespace fiducap {

/// Nothing in a filter looks back further than this, and readings are kept for so long at least.
inline constexpr Duration kFilterPast = std::chrono::seconds(3);

/// The readings since the oldest instant that is still needed, whether to believe them, and
/// what they say about any moment between them. Bounded by time at the unit's rate; allocates
/// nothing after construction.
class ImuBuffer final {
 public:
  /// @param max_gap_s         longer holes count as a gap
  /// @param gap_accel_noise   acceleration density that bridges a gap, m/s²/√Hz
  /// @param past              readings of so long have room
  ImuBuffer(const ImuNoise& noise, double max_gap_s, double gap_accel_noise,
            Duration past = kFilterPast);

  /// When it is full the oldest goes.
  /// @return false for a reading that is not newer than the last one, or not finite: it is left
  /// out.
  bool push(const ImuSample& imu);
  [[nodiscard]] std::size_t size() const { return size_; }
  /// @param i  0: the oldest
  [[nodiscard]] const JudgedReading& reading(std::size_t i) const {
    return ring_[(begin_ + i) % ring_.size()];
  }
  [[nodiscard]] std::optional<ImuSample> newest() const;
  /// Largest axis of the readings that were not believed so far; 0: all were.
  struct RangesMet {
    double gyro_rad_s{0};
    double accel_m_s2{0};
  };
  [[nodiscard]] const RangesMet& ranges_met() const { return ranges_met_; }
  /// The newest rate is at the end of the gyro's range.
  [[nodiscard]] bool is_gyro_blind() const {
    return size_ > 0 && reading(size_ - 1).saturated.gyro;
  }
  /// @pre at least two readings
  [[nodiscard]] const ImuSample& before_newest() const { return reading(size_ - 2).imu; }
  /// So many readings that they must be used now.
  [[nodiscard]] bool is_full() const { return size_ == ring_.size(); }
  /// Older readings may come again.
  void forget_all();
  /// Forgets all but the last two.
  void keep_newest_pair();
  /// Forgets what no interval after `at` needs; the last reading at or before `at` opens the next
  /// interval and stays.
  void forget_before(Instant at);
  /// Index of the first reading after `at`, or the number of readings.
  [[nodiscard]] std::size_t first_after(Instant at) const;

  [[nodiscard]] bool is_gap(Duration hole) const { return to_seconds(hole) > max_gap_s_; }
  /// The end of the interval between two readings that `from` lies in, at most `to`; `to` beyond
  /// the newest reading.
  [[nodiscard]] Instant end_of_interval(Instant from, Instant to) const;
  /// Force and rate halfway between `from` and `to`, linear between the readings around, held
  /// beyond the newest and before the oldest: when that is further than `max_gap_s`, with the noise
  /// of a gap.
  /// @pre both in one interval
  [[nodiscard]] InertialInput input_between(Instant from, Instant to) const;

 private:
  [[nodiscard]] JudgedReading& at(std::size_t i) { return ring_[(begin_ + i) % ring_.size()]; }
  void forget_oldest(std::size_t count);

  ImuNoise noise_;
  double max_gap_s_;
  double gap_accel_noise_;
  SaturationWatch watch_;
  RangesMet ranges_met_;
  std::vector<JudgedReading> ring_;
  std::size_t begin_{0};
  std::size_t size_{0};
};

}  // namespace fiducap
