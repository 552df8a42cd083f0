#pragma once

#include <optional>

#include "capture/imu_sample.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/imu/imu_buffer.hpp"

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
  /// Over the readings, as far as they reach, at most to `to`.
  void transport(BodyEstimate& state, Instant to) const;
  /// Towards reading `next`, at most to `to`: along the line from the one before; there is none: it
  /// is held.
  void advance(BodyEstimate& state, std::size_t next, Instant to) const;
  /// Past the last sample.
  void extrapolate(BodyEstimate& state, Instant to) const;
  void integrate(BodyEstimate& state, const InertialInput& input, Instant to) const;
  void coast(BodyEstimate& state, Instant to) const;
  /// Rate and acceleration of the instant reached.
  void set_rates(BodyEstimate& state, const ImuSample& reading) const;

  bool has_imu_;
  ImuNoise noise_;
  EstimatorConfig config_;
  Eigen::Vector3d gravity_W_;
  ImuBuffer imu_;
  std::optional<BodyEstimate>
      base_;  ///< What the filter said (moved on only when the buffer is full).
  std::optional<BodyEstimate>
      head_;  ///< base_ carried to the newest sample: one step serves most requests.
  std::optional<BodyEstimate>
      before_head_;  ///< The same one sample earlier: a sample may overtake the request.
};

}  // namespace fiducap
