#pragma once

#include <optional>
#include <stop_token>
#include <variant>

#include "base/expected.hpp"
#include "capture/camera_frame.hpp"
#include "capture/imu_sample.hpp"

namespace fiducap {

using SensorSample = std::variant<ImuSample, CameraFrame, CornerFrame>;

/// When the sample was true: `sampled_at` or `exposed_at`.
[[nodiscard]] inline Instant time_of(const SensorSample& sample) {
  struct Time {
    Instant operator()(const ImuSample& s) const { return s.sampled_at; }
    Instant operator()(const CameraFrame& s) const { return s.exposed_at; }
    Instant operator()(const CornerFrame& s) const { return s.exposed_at; }
  };
  return std::visit(Time{}, sample);
}

/// What the filter learned about the sensor's clock; part of time_of().
[[nodiscard]] inline Duration clock_shift_of(const SensorSample& sample) {
  if (const auto* image = std::get_if<CameraFrame>(&sample)) return image->clock_shift;
  const auto* corners = std::get_if<CornerFrame>(&sample);
  return corners != nullptr ? corners->clock_shift : Duration{0};
}

/// Where the samples of one rigid body come from: hardware, a recording, the simulator. What
/// follows cannot tell them apart.
class SensorSource {
 public:
  virtual ~SensorSource() = default;
  /// Waits for the next sample, in order of arrival. Times of one sensor strictly increase; between
  /// sensors a sample may be late, SampleMerger puts that right.
  /// @return nullopt when exhausted or stopped; Error when the device is lost.
  virtual Expected<std::optional<SensorSample>> next(std::stop_token stop) = 0;
};

}  // namespace fiducap
