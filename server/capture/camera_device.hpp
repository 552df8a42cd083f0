#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// How the exposure time of a V4L2 device is chosen.
enum class ExposureMode {
  kManual,  ///< `exposure_s`; 0: not changed.
  kAuto,    ///< By the device, which keeps its rate in the dark.
  kAsIs,    ///< Not changed.
};

namespace words {
inline constexpr std::array<Word<ExposureMode>, 3> kExposureMode{{{"manual", ExposureMode::kManual},
                                                                  {"auto", ExposureMode::kAuto},
                                                                  {"as_is", ExposureMode::kAsIs}}};
}  // namespace words

/// A camera without IMU: a V4L2 device, a GStreamer pipeline, libcamera, RTSP or a video file.
///
/// V4L2 settings (`format` to `power_line`) are read back and logged. `as_is`: unchanged.
struct CameraDeviceConfig {
  /// `/dev/video0`, `0` or `/dev/v4l/by-id/…`; `libcamera:` or `libcamera:NAME`; `rtsp://…`; a
  /// GStreamer pipeline ending in appsink; or a video file.
  std::string open;
  /// Requested of a device; 0: as calibrated, or as it is. Must match the calibration.
  int width{0};
  int height{0};      ///< As `width`.
  double rate_hz{0};  ///< Requested of a device (0: the highest); overrides the rate of a file.
  double exposure_s{0.0};  ///< Set on a V4L2 device (`exposure`), else the known value.
  double latency_s{0.0};   ///< From the end of exposure to the stamp, or to arrival without one.
  bool paced{true};        ///< File: deliver at its own rate (false: as fast as it is read).
  bool loop{false};        ///< File: start again at the end.
  Duration time_shift{0};  ///< Added to the stamp (CameraMount::time_shift).

  std::string format{"auto"};  ///< GREY, MJPEG, YUYV, Y10, …; `auto`: the fastest measured.
  ExposureMode exposure{ExposureMode::kManual};
  std::string gain{"as_is"};           ///< `auto`, or a number of the device.
  std::string white_balance{"as_is"};  ///< `auto`, or kelvin.
  std::string focus{"as_is"};          ///< `auto`, or a number of the device: 0 is far away.
  std::string trigger{"as_is"};        ///< `off`, `on`, or a number of the device.
  std::string power_line{"as_is"};     ///< Against flicker: `off`, `auto`, `50`, `60`.

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

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

[[nodiscard]] std::vector<ConfigError> check_source(const CameraDeviceConfig& config,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

/// A video file: it ends, and is not reopened.
[[nodiscard]] bool is_file(const CameraDeviceConfig& config);

/// A file ends with nullopt, others with an Error. V4L2 stops within 0.1 s, others after an image.
/// @param camera  width 0: not calibrated yet, any size
/// @return Error with device, wanted and given size when it cannot be opened.
[[nodiscard]] OpenedSource open_camera_device(const CameraDeviceConfig& config,
                                              const CameraModel& camera, const Clock& clock);

/// @param camera  width 0: not calibrated, any size   @param name  for messages
[[nodiscard]] Expected<void> fits_calibration(PixelSize size, const CameraModel& camera,
                                              const std::string& name);

namespace v4l2 {
class Port;

/// The same for a V4L2 device behind `port`, in its fastest mode, stamped by the kernel.
///
/// Ends with an Error when images stop. Allocates nothing later on, except in libjpeg.
/// @param device  for messages
[[nodiscard]] OpenedSource open_v4l2_camera(std::unique_ptr<Port> port, const std::string& device,
                                            const CameraDeviceConfig& config,
                                            const CameraModel& camera, const Clock& clock);
}  // namespace v4l2

/// The configured value of a control of a camera.
struct ControlSetting {
  enum class Kind { kAsIs, kAuto, kOff, kOn, kNumber };
  Kind kind{Kind::kAsIs};  ///< kAsIs: not changed.
  std::int32_t number{};

  bool operator==(const ControlSetting&) const = default;
};

/// `as_is`, `auto`, `off`, `on` or a whole number; nullopt: none of them.
[[nodiscard]] std::optional<ControlSetting> parse_control_setting(std::string_view text);

}  // namespace fiducap
