#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "capture/imu_sample.hpp"
#include "estimation/estimator_config.hpp"

namespace fiducap {

/// Inertial input of one integration step, biases not removed, and its noise.
struct InertialInput {
  Eigen::Vector3d w_B{Eigen::Vector3d::Zero()};  ///< rad/s
  Eigen::Vector3d f_B{Eigen::Vector3d::Zero()};  ///< m/s²
  /// False: no accelerometer; the body's acceleration is white noise of density `accel_noise` and
  /// gravity is not used.
  bool has_accelerometer{true};
  /// Odometry instead of an accelerometer: velocity in the body axes at the start of the step, with
  /// `w_B` as rate and `gyro_noise` and `velocity_noise`. Only in segments, not in filters.
  std::optional<Eigen::Vector3d> v_B{};  ///< m/s
  double velocity_noise{};               ///< m/s/√Hz
  double gyro_noise{};                   ///< rad/s/√Hz
  double accel_noise{};                  ///< m/s²/√Hz
  double gyro_walk{};                    ///< rad/s²/√Hz
  double accel_walk{};                   ///< m/s³/√Hz

  void scale_noise(double factor) {
    gyro_noise *= factor;
    accel_noise *= factor;
    gyro_walk *= factor;
    accel_walk *= factor;
  }
};

/// Motion of a body without IMU: white noise acceleration and angular acceleration.
[[nodiscard]] inline InertialInput motion_without_imu(const EstimatorConfig& config) {
  InertialInput input;
  input.has_accelerometer = false;
  input.accel_noise = config.motion_accel_m_s2_rtHz;
  input.gyro_walk = config.motion_angular_rad_s2_rtHz;
  return input;
}

/// Saturated sensors of a unit.
struct Saturated {
  bool gyro{false};
  bool accel{false};
};

/// An IMU sample with its saturation flags.
struct JudgedReading {
  ImuSample imu;
  Saturated saturated;
};

/// White rate noise of a saturated gyro or a gap in the stream.
inline constexpr double kBlindRate_rad_s_rtHz = 1.0;

/// Finds saturated samples.
///
/// Either by the known range (ImuNoise), or by a run of equal values of one axis that is too long
/// to be chance while another axis changes. The share of earlier repeats (a coarse sensor at rest)
/// gives the possible length of a run. A unit with all axes unchanged is at rest or dead.
class SaturationWatch final {
 public:
  explicit SaturationWatch(const ImuNoise& unit) : unit_(unit) {}

  struct Finding {
    Saturated now;
    std::size_t gyro_since{0};   ///< Earlier samples found saturated now, of the gyroscope …
    std::size_t accel_since{0};  ///< … and of the accelerometer.
  };
  [[nodiscard]] Finding look_at(const ImuSample& imu);

 private:
  struct Axis {
    double last{0};
    int changes{0};       ///< Bounded count of changes.
    double repeats{0.5};  ///< Fading share of repeats, without the present run.
    int run{0};           ///< Repeats up to now.
    bool is_flat{false};
  };

  /// @return earlier samples found saturated now
  static std::size_t judge(Axis& axis, double value, bool others_move);

  ImuNoise unit_;
  std::array<Axis, 6> axes_{};
};

/// Longest time into the past that a filter uses; samples are kept at least as long.
inline constexpr Duration kFilterPast = std::chrono::seconds(3);

/// IMU samples since the oldest instant still needed, with saturation flags and interpolation.
/// Bounded by time at the unit's rate; allocates nothing after construction.
class ImuBuffer final {
 public:
  /// @param max_gap_s         longest interval between samples that is not a gap
  /// @param gap_accel_noise   acceleration noise density in a gap, m/s²/√Hz
  /// @param past              capacity
  ImuBuffer(const ImuNoise& noise, double max_gap_s, double gap_accel_noise,
            Duration past = kFilterPast);

  /// Drops the oldest sample when full.
  /// @return false: the sample is not newer than the last one or not finite, and is ignored
  bool push(const ImuSample& imu);
  [[nodiscard]] std::size_t size() const { return size_; }
  /// @param i  0: the oldest
  [[nodiscard]] const JudgedReading& reading(std::size_t i) const {
    return ring_[(begin_ + i) % ring_.size()];
  }
  [[nodiscard]] std::optional<ImuSample> newest() const;
  /// Largest axis of the saturated samples so far; 0: none.
  struct RangesMet {
    double gyro_rad_s{0};
    double accel_m_s2{0};
  };
  [[nodiscard]] const RangesMet& ranges_met() const { return ranges_met_; }
  /// The newest rate is saturated.
  [[nodiscard]] bool is_gyro_blind() const {
    return size_ > 0 && reading(size_ - 1).saturated.gyro;
  }
  /// @pre at least two readings
  [[nodiscard]] const ImuSample& before_newest() const { return reading(size_ - 2).imu; }
  /// The next push() drops a sample.
  [[nodiscard]] bool is_full() const { return size_ == ring_.size(); }
  /// Afterwards older samples are accepted again.
  void forget_all();
  /// Forgets all but the last two.
  void keep_newest_pair();
  /// Drops samples before the last one at or before `at`, which begins the next interval.
  void forget_before(Instant at);
  /// Index of the first sample after `at`, or size().
  [[nodiscard]] std::size_t first_after(Instant at) const;

  [[nodiscard]] bool is_gap(Duration hole) const { return to_seconds(hole) > max_gap_s_; }
  /// End of the interval between two samples that contains `from`, at most `to`; `to` after the
  /// newest sample.
  [[nodiscard]] Instant end_of_interval(Instant from, Instant to) const;
  /// Force and rate at the middle of `from` and `to`: interpolated, or held outside the samples.
  /// Has the noise of a gap beyond `max_gap_s`.
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
