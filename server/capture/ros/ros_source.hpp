#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/ros/ros_config.hpp"
#include "capture/sensor_source.hpp"
#include "middleware/participant.hpp"

namespace fiducap::dds {

/// Images and inertial readings from topics of ROS 2. Never ends and is never lost: a driver that
/// stops may start again. What does not fit (size, encoding, stamp) is left out and said once.
/// @param cameras  with their lenses, in the order of config.images
/// @return Error when a topic cannot be subscribed to
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_ros_source(
    std::shared_ptr<Participant> participant, const RosSourceConfig& config,
    const std::vector<CameraMount>& cameras, const Clock& clock);

/// UTC of this machine, of which stamps of ROS are.
[[nodiscard]] std::int64_t utc_now_ns();

/// Puts the lens of every camera that has none (width 0) from its `camera_info`, waiting for it.
/// @return Error naming the topic on which nothing usable came in time
[[nodiscard]] Expected<void> ask_for_lenses(const Participant& participant,
                                            const RosSourceConfig& config,
                                            std::vector<CameraMount>& cameras, const Clock& clock);

}  // namespace fiducap::dds
