#pragma once

#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/imu/mavlink_config.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// The IMU of an autopilot, in axes x forward, y left, z up of its body. Never ends; a serial line
/// that is gone is lost, a vehicle that is silent may come back.
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_mavlink_source(
    const MavlinkImuConfig& config, const Clock& clock);

}  // namespace fiducap
