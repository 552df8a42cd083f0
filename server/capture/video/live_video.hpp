#pragma once

#include <memory>
#include <optional>

#include "base/clock.hpp"
#include "capture/camera_device.hpp"
#include "capture/sensor_source.hpp"
#include "capture/video/video_stream.hpp"

namespace fiducap::video {

/// A pipeline or a camera on the network: images are stamped when they arrive.
class LiveVideo final : public SensorSource {
 public:
  LiveVideo(std::unique_ptr<VideoStream> stream, const CameraDeviceConfig& config,
            const Clock& clock);
  Expected<std::optional<SensorSample>> next(std::stop_token stop) override;

 private:
  std::unique_ptr<VideoStream> stream_;
  std::string name_;
  Duration before_arrival_;
  const Clock& clock_;
  std::optional<Instant> last_;
};

}  // namespace fiducap::video
