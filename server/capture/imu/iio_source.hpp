#pragma once

#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/imu/iio_config.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// An IMU of Linux's Industrial I/O: buffers with the kernel's stamps, by libiio. Lost when the
/// device or its server is.
/// @return Error naming what there is instead; kUnsupported when the server was built without
/// libiio
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_iio_source(const IioConfig& config,
                                                                      const Clock& clock);

}  // namespace fiducap
