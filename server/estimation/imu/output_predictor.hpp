#pragma once

#include <optional>

#include "capture/imu_sample.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/imu/imu_buffer.hpp"

namespace fiducap {

/// Propagates the newest filter estimate by the newer IMU samples to a requested instant, mean and
/// covariance: late images add no latency to the output.
///
/// Samples are interpolated at the middle of each step; rotation increments are exact. After the
/// last sample rate and specific force are held for `max_imu_gap_s`; saturated samples are used
/// with large noise. After that, in longer gaps and for bodies without IMU, velocity and body rate
/// are held with the motion noise of EstimatorConfig. Without IMU `bias_w` is minus the body rate,
/// with the rate's covariance.
///
/// Bounded memory (one second of samples), no allocation after construction. Not thread-safe.
class OutputPredictor final {
 public:
  /// @param sensors  IMU noise (or its absence) and gravity
  OutputPredictor(const BodySensors& sensors, const EstimatorConfig& config);

  /// Adds a sample of the device, before merging. Late, repeated and non-finite samples are
  /// ignored; one that is more than a second late restarts the device's time line.
  void add_imu(const ImuSample& imu);
  /// Sets the filter's newest estimate and drops older IMU samples.
  void set_estimate(const BodyEstimate& estimate);
  /// The body is lost: no prediction until the next estimate.
  void clear();
  /// @return nullopt before the first estimate; for `at` before the newest estimate: that estimate
  ///         moved back by its velocity and rate (by one image interval at most)
  [[nodiscard]] std::optional<BodyEstimate> predict(Instant at) const;

 private:
  /// Integrates the samples, at most to `to`.
  void transport(BodyEstimate& state, Instant to) const;
  /// Integrates towards sample `next`, at most to `to`.
  void advance(BodyEstimate& state, std::size_t next, Instant to) const;
  /// Continues after the last sample.
  void extrapolate(BodyEstimate& state, Instant to) const;
  void integrate(BodyEstimate& state, const InertialInput& input, Instant to) const;
  void coast(BodyEstimate& state, Instant to) const;
  /// Sets rate and acceleration at the instant reached.
  void set_rates(BodyEstimate& state, const ImuSample& reading) const;

  bool has_imu_;
  ImuNoise noise_;
  EstimatorConfig config_;
  Eigen::Vector3d gravity_W_;
  ImuBuffer imu_;
  std::optional<BodyEstimate> base_;         ///< The filter's; propagated when the buffer is full.
  std::optional<BodyEstimate> head_;         ///< base_ propagated to the newest sample.
  std::optional<BodyEstimate> before_head_;  ///< base_ propagated to the sample before it.
};

}  // namespace fiducap
