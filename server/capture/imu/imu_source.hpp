#pragma once

#include <functional>
#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/imu/imu_source_config.hpp"
#include "capture/sensor_source.hpp"
#include "middleware/participant.hpp"

namespace fiducap {

/// What IMU sources need beside their configuration. Each takes what it wants.
struct ImuOpening {
  const Clock& clock;  ///< Outlives the source.
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds;
};

/// Opens an IMU: a source of nothing but ImuSample, in the body's axes (x forward, y left, z up)
/// and in SI units. It never ends; when it is lost (unplugged, closed), `next` gives an Error, and
/// it may be opened again.
/// @return Error naming the device and what to do
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_imu_source(const ImuSourceConfig& config,
                                                                      const ImuOpening& opening);

}  // namespace fiducap
