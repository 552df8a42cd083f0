#pragma once

#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/imu/imu_source_config.hpp"
#include "capture/sensor_source.hpp"
#include "middleware/participant.hpp"

namespace fiducap::dds {

/// The IMU of PX4 over its uXRCE-DDS bridge (`SensorCombined`), in axes x forward, y left, z up of
/// the autopilot's body. Its stamps are the agent's UTC (UXRCE_DDS_SYNCT, PX4's default), or its
/// own clock, placed by arrival. Never ends and is never lost.
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_px4_source(
    std::shared_ptr<Participant> participant, const ImuTopicConfig& config, const Clock& clock);

}  // namespace fiducap::dds
