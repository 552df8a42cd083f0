#pragma once

#include <memory>
#include <optional>
#include <stop_token>
#include <variant>
#include <vector>

#include "base/expected.hpp"
#include "capture/camera_frame.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"

namespace fiducap {

using SensorSample = std::variant<ImuSample, CameraFrame, CornerFrame>;

/// `sampled_at` or `exposed_at`.
[[nodiscard]] inline Instant time_of(const SensorSample& sample) {
  if (const auto* imu = std::get_if<ImuSample>(&sample)) return imu->sampled_at;
  if (const auto* image = std::get_if<CameraFrame>(&sample)) return image->exposed_at;
  return std::get<CornerFrame>(sample).exposed_at;
}
inline void set_time(SensorSample& sample, Instant at) {
  if (auto* imu = std::get_if<ImuSample>(&sample)) imu->sampled_at = at;
  if (auto* image = std::get_if<CameraFrame>(&sample)) image->exposed_at = at;
  if (auto* corners = std::get_if<CornerFrame>(&sample)) corners->exposed_at = at;
}

/// The filter's correction of the sensor's clock; part of time_of().
[[nodiscard]] inline Duration clock_shift_of(const SensorSample& sample) {
  if (const auto* image = std::get_if<CameraFrame>(&sample)) return image->clock_shift;
  const auto* corners = std::get_if<CornerFrame>(&sample);
  return corners != nullptr ? corners->clock_shift : Duration{0};
}

/// Samples of one rigid body, from hardware, a recording or the simulator.
class SensorSource {
 public:
  virtual ~SensorSource() = default;
  /// Waits for the next sample by arrival. Times strictly increase per sensor (SampleMerger sorts).
  /// @return nullopt when exhausted or stopped; Error when the device is lost.
  virtual Expected<std::optional<SensorSample>> next(std::stop_token stop) = 0;
};
using OpenedSource = Expected<std::unique_ptr<SensorSource>>;

/// The rest of a body's configuration, for the rules of its source.
struct SourceSurroundings {
  std::vector<CameraMount> cameras;  ///< As configured; files are not read yet.
  bool calibrated_by_files{false};   ///< Some of the cameras.
  bool has_imu{false};               ///< An IMU is described.
  bool has_imu_source{false};        ///< The IMU has a source of its own.
  std::vector<bool> has_source{};    ///< Per camera: it has a source of its own.
};

}  // namespace fiducap
