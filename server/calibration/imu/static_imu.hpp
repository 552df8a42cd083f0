#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "calibration/imu/allan_deviation.hpp"
#include "capture/imu_sample.hpp"

namespace fiducap {

/// Axes in the order gyro x y z, accelerometer x y z.
inline constexpr std::size_t kImuAxes = 6;

/// What a recording of an IMU that lies still says about its noise.
struct StaticImuNoise {
  double seconds{};
  double rate_hz{};
  long samples{};
  long lost{};  ///< Samples that their neighbours' stamps say are missing.
  std::array<std::vector<AllanPoint>, kImuAxes> plot;
  std::array<AxisNoise, kImuAxes> axes;
  /// One number per sensor, as filters take it: root mean square over the axes. A walk that no axis
  /// shows is its bound.
  ImuNoise noise;
  bool gyro_walk_seen{};  ///< On at least one axis; else noise.gyro_walk… is an upper bound.
  bool accel_walk_seen{};
};

/// @return Error when the recording is too short for any statement, has holes, or the IMU moved; it
/// says when.
[[nodiscard]] Expected<StaticImuNoise> identify_static_imu(std::span<const ImuSample> samples,
                                                           const std::string& context);

}  // namespace fiducap
