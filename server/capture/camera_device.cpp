#include "capture/camera_device.hpp"

#include <algorithm>
#include <utility>

#include "base/text.hpp"
#include "capture/v4l2/device.hpp"
#include "capture/v4l2/pixel_format.hpp"
#include "capture/video/video_source.hpp"

namespace fiducap {
namespace {

constexpr std::string_view kLibcameraPrefix = "libcamera:";

using video::VideoKind;

bool is_number(const std::string& text) {
  return !text.empty() && text.size() <= 3 &&
         text.find_first_not_of("0123456789") == std::string::npos;
}

bool is_pipeline(const std::string& open) { return open.find('!') != std::string::npos; }

/// @return nullopt: a V4L2 device
std::optional<VideoKind> kind_of(const std::string& open) {
  if (is_pipeline(open) || open.starts_with(kLibcameraPrefix)) return VideoKind::kPipeline;
  if (open.starts_with("rtsp://") || open.starts_with("rtsps://")) return VideoKind::kNetwork;
  if (is_number(open) || open.starts_with("/dev/")) return std::nullopt;
  return VideoKind::kFile;
}

/// What OpenCV opens. The pipeline of `libcamera:NAME` drops all but the newest image.
std::string video_of(const CameraDeviceConfig& config, const CameraModel& camera) {
  if (is_pipeline(config.open) || !config.open.starts_with(kLibcameraPrefix)) return config.open;
  const std::string name = config.open.substr(kLibcameraPrefix.size());
  const bool is_configured = config.width > 0;
  const int width = is_configured ? config.width : camera.width;
  const int height = is_configured ? config.height : camera.height;
  std::string caps = "video/x-raw,format=NV12";
  if (width > 0) caps += ",width=" + std::to_string(width) + ",height=" + std::to_string(height);
  if (config.rate_hz > 0)
    caps +=
        ",framerate=" + std::to_string(static_cast<long>(config.rate_hz * 1000 + 0.5)) + "/1000";
  return "libcamerasrc" + (name.empty() ? "" : " camera-name=\"" + name + "\"") + " ! " + caps +
         " ! videoconvert ! video/x-raw,format=GRAY8 ! appsink max-buffers=1 drop=true sync=false";
}

using SettingKind = ControlSetting::Kind;

void require_setting(Checker& checker, const char* key, const std::string& text,
                     std::initializer_list<SettingKind> allowed, const char* rule) {
  const auto setting = parse_control_setting(text);
  const bool holds = setting && (setting->kind == SettingKind::kAsIs ||
                                 std::ranges::find(allowed, setting->kind) != allowed.end());
  checker.require(holds, key, text, rule);
}

}  // namespace

bool is_file(const CameraDeviceConfig& config) { return kind_of(config.open) == VideoKind::kFile; }

std::vector<ConfigError> CameraDeviceConfig::check(const std::string& prefix) const {
  Checker checker{prefix};
  checker.require(!open.empty(), "open", open, "must be a device, a file or a pipeline")
      .within("width", width, 0, 65535)
      .within("height", height, 0, 65535)
      .require((width == 0) == (height == 0), "height", height, "must be given together with width")
      .within("rate_hz", rate_hz, 0, 10'000)
      .within("exposure_s", exposure_s, 0, 1)
      .within("latency_s", latency_s, 0, 10)
      .require(format == "auto" || v4l2::pixel_format(std::string_view(format)) != nullptr,
               "format", format,
               "must be one of auto, " +
                   comma_list(v4l2::pixel_formats(), [](const auto& one) { return one.name; }))
      .require(power_line == "as_is" || power_line == "off" || power_line == "auto" ||
                   power_line == "50" || power_line == "60",
               "power_line", power_line, "must be as_is, off, auto, 50 or 60");
  const auto automatic = {SettingKind::kAuto, SettingKind::kNumber};
  require_setting(checker, "gain", gain, automatic, "must be as_is, auto or a whole number");
  require_setting(checker, "white_balance", white_balance, automatic,
                  "must be as_is, auto or a whole number (kelvin)");
  require_setting(checker, "focus", focus, automatic, "must be as_is, auto or a whole number");
  require_setting(checker, "trigger", trigger,
                  {SettingKind::kOff, SettingKind::kOn, SettingKind::kNumber},
                  "must be as_is, off, on or a whole number");
  return checker.errors;
}

OpenedSource open_camera_device(const CameraDeviceConfig& config, const CameraModel& camera,
                                const Clock& clock) {
  const auto kind = kind_of(config.open);
  if (!kind) {
    const std::string device = is_number(config.open) ? "/dev/video" + config.open : config.open;
    auto port = v4l2::open_port(device);
    if (!port) return tl::unexpected(port.error());
    return v4l2::open_v4l2_camera(std::move(*port), device, config, camera, clock);
  }
  auto opened = video::open_video(*kind, config.open, video_of(config, camera), camera);
  if (!opened) return tl::unexpected(opened.error());
  if (kind != VideoKind::kFile)
    return video::make_live_source(std::move(opened->stream), config, clock);
  return std::make_unique<video::VideoFile>(std::move(opened->stream), opened->rate_hz, config,
                                            clock);
}

Expected<void> fits_calibration(PixelSize size, const CameraModel& camera,
                                const std::string& name) {
  const PixelSize calibrated{camera.width, camera.height};
  if (camera.width == 0 || size == calibrated) return {};
  return fail(ErrorCode::kInvalid,
              "gives images of " + size_text(size) + ", the calibration is for " +
                  size_text(calibrated) +
                  ": use the calibration of this mode, or request the calibrated size",
              name);
}

std::vector<ConfigError> check_source(const CameraDeviceConfig& config,
                                      const SourceSurroundings& around,
                                      const std::string& body_prefix) {
  Checker rules{body_prefix, config.check(body_prefix + "source.")};
  rules
      .require(around.cameras.size() == 1, "cameras",
               std::to_string(around.cameras.size()) + " entries",
               "a camera source has exactly one camera")
      .require(!around.has_imu || around.has_imu_source, "imu", "{…}",
               "a camera has no IMU: configure its source in `imu_source`");
  return rules.errors;
}

std::optional<ControlSetting> parse_control_setting(std::string_view text) {
  using Kind = ControlSetting::Kind;
  if (text == "as_is") return ControlSetting{Kind::kAsIs};
  if (text == "auto") return ControlSetting{Kind::kAuto};
  if (text == "off") return ControlSetting{Kind::kOff};
  if (text == "on") return ControlSetting{Kind::kOn};
  ControlSetting setting{Kind::kNumber};
  return parse_number(text, setting.number) ? std::optional(setting) : std::nullopt;
}

}  // namespace fiducap
