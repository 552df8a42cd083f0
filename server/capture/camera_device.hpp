#pragma once

#include <array>
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

/// Who decides how long a V4L2 device exposes.
enum class ExposureMode {
  kManual,  ///< We do: `exposure_s`. 0: it is left as it is.
  kAuto,    ///< The device does, and keeps its rate in the dark.
  kAsIs,    ///< Whoever set it before; it is not touched.
};

namespace words {
inline constexpr std::array<Word<ExposureMode>, 3> kExposureMode{{{"manual", ExposureMode::kManual},
                                                                  {"auto", ExposureMode::kAuto},
                                                                  {"as_is", ExposureMode::kAsIs}}};
}  // namespace words

/// A camera by itself: a V4L2 device, a GStreamer pipeline, libcamera, RTSP or a video file. No
/// IMU.
///
/// The settings from `format` to `power_line` are those of V4L2 devices: set, read back, and what
/// the device made of them is said. Each is `as_is` (not touched) or what stands beside it.
struct CameraDeviceConfig {
  /// `/dev/video0`, `0` or `/dev/v4l/by-id/…`; `libcamera:` or `libcamera:NAME`; `rtsp://…`; a
  /// GStreamer pipeline ending in appsink; or a video file.
  std::string open;
  int width{
      0};  ///< Asked of a device; 0: as calibrated, or as it comes. Must match the calibration.
  int height{0};
  double rate_hz{0};       ///< Asked of a device (0: the highest), or overrides the rate of a file.
  double exposure_s{0.0};  ///< Set on a V4L2 device (`exposure`), else what it is known to be.
  double latency_s{0.0};   ///< End of exposure → stamp. Without a kernel's stamp: → arrival.
  bool paced{true};        ///< File: deliver at its own rate (false: as fast as it is read).
  bool loop{false};        ///< File: start again at the end.
  Duration time_shift{0};  ///< Added to the stamp (CameraMount::time_shift).

  std::string format{"auto"};  ///< GREY, MJPEG, YUYV, Y10, …; `auto`: the quickest, as measured.
  ExposureMode exposure{ExposureMode::kManual};
  std::string gain{"as_is"};           ///< `auto`, or a number of the device.
  std::string white_balance{"as_is"};  ///< `auto`, or kelvin.
  std::string focus{"as_is"};          ///< `auto`, or a number of the device: 0 is far away.
  std::string trigger{"as_is"};        ///< `off`, `on`, or a number of the device.
  std::string power_line{"as_is"};     ///< Against flicker: `off`, `auto`, `50`, `60`.

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// Keys of a configuration, see daemon/config/config_schema.hpp.
template <class V>
void describe(V& v, CameraDeviceConfig& c) {
  v.device("open", c.open);
  v.value("width", c.width);
  v.value("height", c.height);
  v.value("rate_hz", c.rate_hz);
  v.value("format", c.format);
  v.word("exposure", c.exposure, words::kExposureMode);
  v.value("exposure_s", c.exposure_s);
  v.value("latency_s", c.latency_s);
  v.value("gain", c.gain);
  v.value("white_balance", c.white_balance);
  v.value("focus", c.focus);
  v.value("trigger", c.trigger);
  v.value("power_line", c.power_line);
  v.value("loop", c.loop);
}

/// Rules about the rest of the body.
[[nodiscard]] std::vector<ConfigError> check_source(const CameraDeviceConfig& config,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

/// A video file: it ends, and does not come back.
[[nodiscard]] bool is_file(const CameraDeviceConfig& config);

/// A file ends with nullopt, everything else that gives nothing more with an Error. A V4L2 device
/// sees a stop within a tenth of a second, the others between two images.
/// @param camera  width 0: not calibrated yet, any size will do
/// @return Error naming device, wanted and given size when it cannot be opened.
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_camera_device(
    const CameraDeviceConfig& config, const CameraModel& camera, const Clock& clock);

}  // namespace fiducap
