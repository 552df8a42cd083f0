#pragma once

#include <optional>
#include <vector>

#include "capture/imu_sample.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/imu/saturation_watch.hpp"

namespace fiducap {

/// Carries the newest filter estimate over the newer IMU samples to the instant asked for, mean and
/// covariance, so that late images cost no latency at the wire.
///
/// Between two samples the reading is their straight line, taken at the middle of each step;
/// rotation increments are exact. Beyond the last sample rate and specific force are held for
/// `max_imu_gap_s`; a reading at the end of the sensor's range is used, but hardly believed; after
/// that, in longer holes of the stream and for bodies without IMU, velocity and body rate are held
/// and the motion noise of EstimatorConfig grows. Without IMU `bias_w` is minus the body rate and
/// its covariance block that of the rate.
///
/// Bounded memory (one second of samples), no allocation after construction. Not thread-safe;
/// scene/ guards it.
class OutputPredictor final {
 public:
  /// @param sensors  IMU noise (or its absence) and gravity
  OutputPredictor(const BodySensors& sensors, const EstimatorConfig& config);

  /// A reading straight from the device, before any merging. Late, repeated and non-finite readings
  /// are ignored; one that is more than a second late means that the device's time line started
  /// again.
  void add_imu(const ImuSample& imu);
  /// The filter's newest estimate; older IMU samples are forgotten, newer ones applied again.
  void set_estimate(const BodyEstimate& estimate);
  /// The body is lost: no prediction until the next estimate.
  void clear();
  /// @return nullopt before the first estimate; for `at` before the newest estimate: that estimate
  /// moved back by its
  ///         velocity and rate (at most one image interval is sensible).
  [[nodiscard]] std::optional<BodyEstimate> predict(Instant at) const;

 private:
  [[nodiscard]] JudgedReading& reading(std::size_t i) {
    return ring_[(ring_begin_ + i) % ring_.size()];
  }
  [[nodiscard]] const JudgedReading& reading(std::size_t i) const {
    return ring_[(ring_begin_ + i) % ring_.size()];
  }
  [[nodiscard]] bool is_gap(Duration hole) const;
  void push(const ImuSample& imu);
  void forget_before_base();
  /// Over the samples of the ring, as far as they reach, at most to `to`.
  void carry(BodyEstimate& state, Instant to) const;
  /// Along the line between two samples. @param before  nullptr: `after` is held
  void advance(BodyEstimate& state, const JudgedReading* before, const JudgedReading& after,
               Instant to) const;
  /// Past the last sample.
  void extrapolate(BodyEstimate& state, Instant to) const;
  void integrate(BodyEstimate& state, const ImuSample& reading, Saturated saturated,
                 Instant to) const;
  void coast(BodyEstimate& state, Instant to) const;
  /// Rate and acceleration of the instant reached.
  void set_rates(BodyEstimate& state, const ImuSample& reading) const;

  bool has_imu_;
  ImuNoise noise_;
  EstimatorConfig config_;
  Eigen::Vector3d gravity_W_;
  SaturationWatch watch_;
  std::vector<JudgedReading> ring_;
  std::size_t ring_begin_{0};
  std::size_t ring_size_{0};
  std::optional<BodyEstimate>
      base_;  ///< What the filter said (moved on only when the ring is full).
  std::optional<BodyEstimate>
      head_;  ///< base_ carried to the newest sample: one step serves most requests.
  std::optional<BodyEstimate>
      before_head_;  ///< The same one sample earlier: a sample may overtake the request.
};

}  // namespace fiducap
