#pragma once

#include <memory>
#include <string>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/camera_device.hpp"
#include "capture/v4l2/v4l2_port.hpp"

namespace fiducap::v4l2 {

/// A camera by the kernel's own interface: set as configured, in its quickest mode, stamped by the
/// kernel. Says once what it is, what it was set to, and what is not as asked.
///
/// Ends with an Error when images stop, so that it is opened anew. A copy of the gray pixels is all
/// that is done to an image (a JPEG is decoded); nothing is allocated after the first few but by
/// libjpeg.
/// @param device  for messages
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_v4l2_camera(
    std::unique_ptr<Port> port, const std::string& device, const CameraDeviceConfig& config,
    const CameraModel& camera, const Clock& clock);

}  // namespace fiducap::v4l2
