#pragma once

#include <optional>
#include <vector>

#include "capture/imu_sample.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/body_filter.hpp"

namespace fiducap {

/// Carries the newest filter estimate over the newer IMU samples to the instant asked for, mean and covariance, so
/// that late images cost no latency at the wire. Beyond the last IMU sample rate and specific force are held.
///
/// Bounded memory, no allocation after construction. Not thread-safe; scene/ guards it.
class OutputPredictor final {
 public:
  /// @param sensors  IMU noise (or its absence) and gravity
  OutputPredictor(const BodySensors& sensors, const EstimatorConfig& config);

  /// A reading straight from the device, before any merging.
  void add_imu(const ImuSample& imu);
  /// The filter's newest estimate; older IMU samples are forgotten, newer ones applied again.
  void set_estimate(const BodyEstimate& estimate);
  /// The body is lost: no prediction until the next estimate.
  void clear();
  /// @return nullopt before the first estimate; for `at` before the newest estimate: that estimate moved back by its
  ///         velocity and rate (at most one image interval is sensible).
  [[nodiscard]] std::optional<BodyEstimate> predict(Instant at) const;

 private:
  void step(BodyEstimate& state, const ImuSample& imu, Instant to) const;

  bool has_imu_;
  ImuNoise noise_;
  EstimatorConfig config_;
  Eigen::Vector3d gravity_W_;
  std::vector<ImuSample> ring_;
  std::size_t ring_begin_{0};
  std::size_t ring_size_{0};
  std::optional<BodyEstimate> head_;
  std::optional<ImuSample> newest_;
};

}  // namespace fiducap
