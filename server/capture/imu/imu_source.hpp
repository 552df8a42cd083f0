#pragma once

#include <functional>
#include <memory>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/imu/imu_source_config.hpp"
#include "capture/sensor_source.hpp"
#include "middleware/participant.hpp"

namespace fiducap {

struct ImuOpening {
  const Clock& clock;  ///< Outlives the source.
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds;
};

/// Opens an IMU: a source of ImuSample only, in the body's axes (x forward, y left, z up) and in SI
/// units. It never ends; when it is lost, `next` gives an Error, and it may be opened again.
/// @return Error with device and remedy
[[nodiscard]] OpenedSource open_imu_source(const ImuSourceConfig& config,
                                           const ImuOpening& opening);

// Of one type, in the axes and units of the sensor; MAVLink in flu.

/// A microcontroller with the line protocol (docs/imu-line-protocol.md).
[[nodiscard]] OpenedSource open_line_source(const LinkConfig& config, const Clock& clock);

/// An autopilot. It may be silent for any time; a disconnected serial line is lost.
[[nodiscard]] OpenedSource open_mavlink_source(const MavlinkImuConfig& config, const Clock& clock);

/// Linux's Industrial I/O by libiio: buffers with the kernel's stamps.
/// @return Error with the devices present; kUnsupported without libiio
[[nodiscard]] OpenedSource open_iio_source(const IioConfig& config, const Clock& clock);

}  // namespace fiducap
