#pragma once

#include <memory>
#include <string>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/imu/link_config.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// An IMU behind a microcontroller that speaks the line protocol (docs/imu-line-protocol.md). Never
/// ends; a serial line that is gone is lost. What cannot be right is left out, counted, and said
/// once.
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_line_source(const LinkConfig& config,
                                                                       const Clock& clock);

}  // namespace fiducap
