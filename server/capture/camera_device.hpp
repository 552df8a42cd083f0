#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/sensor_source.hpp"
#include "capture/source_surroundings.hpp"

namespace fiducap {

/// A video file, a V4L2 device or a GStreamer pipeline, read through OpenCV. One camera, no IMU.
struct CameraDeviceConfig {
  std::string
      open;      ///< `/dev/video0` or `0`; a video file; or a GStreamer pipeline ending in appsink.
  int width{0};  ///< Asked of a device; 0: as it comes. Must match the calibration.
  int height{0};
  double rate_hz{0};       ///< Asked of a device, or overrides the rate of a file; 0: as it comes.
  double exposure_s{0.0};  ///< The stamp of a live image is arrival − latency_s − exposure_s / 2.
  double latency_s{0.0};   ///< End of exposure → arrival.
  bool paced{true};        ///< File: deliver at its own rate (false: as fast as it is read).
  bool loop{false};        ///< File: start again at the end.
  Duration time_shift{0};  ///< Added to the stamp (CameraMount::time_shift).

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// Keys of a configuration, see daemon/config/config_schema.hpp.
template <class V>
void describe(V& v, CameraDeviceConfig& c) {
  v.device("open", c.open);
  v.value("width", c.width);
  v.value("height", c.height);
  v.value("rate_hz", c.rate_hz);
  v.value("exposure_s", c.exposure_s);
  v.value("latency_s", c.latency_s);
  v.value("loop", c.loop);
}

/// Rules about the rest of the body.
[[nodiscard]] std::vector<ConfigError> check_source(const CameraDeviceConfig& config,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

/// A video file, not a device or pipeline.
[[nodiscard]] bool is_file(const CameraDeviceConfig& config);

/// A file ends with nullopt, a device or pipeline that gives nothing more with an Error. A stop is
/// seen between two images: a V4L2 device that hangs is given up by OpenCV after 10 s.
/// @param camera  width 0: not calibrated yet, any size will do
/// @return Error naming device, wanted and given size when it cannot be opened.
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_camera_device(
    const CameraDeviceConfig& config, const CameraModel& camera, const Clock& clock);

}  // namespace fiducap
