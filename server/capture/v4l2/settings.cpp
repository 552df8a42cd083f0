#include "capture/v4l2/settings.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include <linux/videodev2.h>

#include "base/text.hpp"
#include "capture/control_wish.hpp"
#include "capture/v4l2/control.hpp"

namespace fiducap::v4l2 {
namespace {

using Kind = ControlWish::Kind;

constexpr double kExposureUnit_s = 1e-4;  // of V4L2_CID_EXPOSURE_ABSOLUTE

std::string value_text(const Control& control, std::int32_t value) {
  for (const auto& [number, text] : control.choices)
    if (number == value) return std::to_string(value) + " (" + text + ")";
  return std::to_string(value);
}

std::string range_text(const Control& control) {
  std::string text;
  for (const auto& choice : control.choices)
    text += (text.empty() ? "" : ", ") + value_text(control, choice.first);
  if (!text.empty()) return text;
  return std::to_string(control.minimum) + " to " + std::to_string(control.maximum);
}

/// Of a number of units, in seconds: 0.008
std::string exposure_text(std::int32_t units) {
  std::string text = fixed(units * kExposureUnit_s, 4);
  while (text.ends_with('0') && !text.ends_with(".0")) text.pop_back();
  return text;
}

/// The first of those that the device has.
std::optional<Control> first_control(Port& port, std::initializer_list<std::uint32_t> ids) {
  for (const std::uint32_t id : ids)
    if (auto control = control_of(port, id)) return control;
  return std::nullopt;
}

class Settings final {
 public:
  explicit Settings(Port& port) : port_(port) {}

  void exposure(const CameraDeviceConfig& config) {
    if (config.exposure == ExposureMode::kAsIs) return;
    if (config.exposure == ExposureMode::kAuto) return automatic_exposure();
    if (config.exposure_s > 0) manual_exposure(config.exposure_s);
  }

  /// @param automatic  switches the automatic on and off; @param manual  takes the number
  void automatic_or_number(const char* key, const std::string& text, std::uint32_t automatic,
                           std::initializer_list<std::uint32_t> manual) {
    const ControlWish wish = control_wish(text).value_or(ControlWish{});
    if (wish.kind == Kind::kAsIs) return;
    const auto on = control_of(port_, automatic);
    if (wish.kind == Kind::kAuto) {
      if (!on) return say_missing(key, "auto", "it has no automatic for it");
      return set(key, *on, 1, "auto");
    }
    if (on && on->value != 0) (void)set_control(port_, automatic, 0);
    const auto number = first_control(port_, manual);
    if (!number) return say_missing(key, text, "it has no such control");
    set(key, *number, wish.number, text);
  }

  void trigger(const std::string& text) {
    const ControlWish wish = control_wish(text).value_or(ControlWish{});
    if (wish.kind == Kind::kAsIs) return;
    const auto control = control_named(port_, "trigger");
    if (!control)
      return say_missing("trigger", text, "none of its controls has \"trigger\" in its name");
    set("trigger", *control, wish.kind == Kind::kNumber ? wish.number : wish.kind == Kind::kOn,
        text);
  }

  void power_line(const std::string& text) {
    if (text == "as_is") return;
    const auto control = control_of(port_, V4L2_CID_POWER_LINE_FREQUENCY);
    if (!control) return say_missing("power_line", text, "it has no such control");
    const std::int32_t value = text == "50"    ? V4L2_CID_POWER_LINE_FREQUENCY_50HZ
                               : text == "60"  ? V4L2_CID_POWER_LINE_FREQUENCY_60HZ
                               : text == "off" ? V4L2_CID_POWER_LINE_FREQUENCY_DISABLED
                                               : V4L2_CID_POWER_LINE_FREQUENCY_AUTO;
    set("power_line", *control, value, text);
  }

  SettingsReport report;

 private:
  void automatic_exposure() {
    const auto mode = control_of(port_, V4L2_CID_EXPOSURE_AUTO);
    if (!mode) return say_missing("exposure", "auto", "it has no automatic for it");
    // Where a camera has both, "auto" also moves the iris; most have only one of them.
    const std::int32_t value =
        mode->offers(V4L2_EXPOSURE_AUTO) ? V4L2_EXPOSURE_AUTO : V4L2_EXPOSURE_APERTURE_PRIORITY;
    set("exposure", *mode, value, "auto");
    if (control_of(port_, V4L2_CID_EXPOSURE_AUTO_PRIORITY))
      (void)set_control(port_, V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0);  // no longer than its rate
  }

  void manual_exposure(double exposure_s) {
    const std::string asked = shortest(exposure_s);
    if (const auto mode = control_of(port_, V4L2_CID_EXPOSURE_AUTO)) {
      const std::int32_t value = mode->offers(V4L2_EXPOSURE_MANUAL)
                                     ? V4L2_EXPOSURE_MANUAL
                                     : V4L2_EXPOSURE_SHUTTER_PRIORITY;
      if (mode->value != value) (void)set_control(port_, mode->id, value);
    }
    const auto time = control_of(port_, V4L2_CID_EXPOSURE_ABSOLUTE);
    if (!time) {
      const bool in_lines = control_of(port_, V4L2_CID_EXPOSURE).has_value();
      return say_missing("exposure_s", asked,
                         in_lines ? "it counts its exposure in lines of the sensor, not in time: "
                                    "set it with v4l2-ctl, and write here how long that is"
                                  : "its exposure cannot be set: this is taken to be what it is");
    }
    const double units = std::clamp(exposure_s / kExposureUnit_s, 0.0, 1e9);
    const auto wanted =
        std::clamp(static_cast<std::int32_t>(std::lround(units)), time->minimum, time->maximum);
    const auto is = set_control(port_, time->id, wanted);
    if (!is) return say_missing("exposure_s", asked, "it refused");
    const double is_s = *is * kExposureUnit_s;
    constexpr double kSame_s = kExposureUnit_s;  // finer it cannot be asked
    if (std::abs(is_s - exposure_s) <= kSame_s) {
      report.done.push_back("exposure_s " + exposure_text(*is));
    } else {
      report.undone.push_back("exposure_s is " + exposure_text(*is) + ", not " + asked +
                              " as asked: it can do " + exposure_text(time->minimum) + " to " +
                              exposure_text(time->maximum));
    }
  }

  void set(const char* key, const Control& control, std::int32_t wanted, const std::string& asked) {
    const auto is = set_control(port_, control.id, wanted);
    if (is == wanted) return report.done.push_back(std::string(key) + " " + asked);
    const std::string instead = is              ? value_text(control, *is)
                                : control.value ? value_text(control, *control.value)
                                                : "?";
    report.undone.push_back(std::string(key) + " is " + instead + ", not " + asked +
                            " as asked: its control \"" + control.name + "\" takes " +
                            range_text(control));
  }

  void say_missing(const char* key, const std::string& asked, const char* why) {
    report.undone.push_back(std::string(key) + " " + asked + " was asked, but " + why);
  }

  Port& port_;
};

}  // namespace

SettingsReport apply_settings(Port& port, const CameraDeviceConfig& config) {
  Settings settings(port);
  settings.power_line(config.power_line);
  settings.trigger(config.trigger);
  settings.exposure(config);
  settings.automatic_or_number("gain", config.gain, V4L2_CID_AUTOGAIN,
                               {V4L2_CID_GAIN, V4L2_CID_ANALOGUE_GAIN});
  settings.automatic_or_number("white_balance", config.white_balance, V4L2_CID_AUTO_WHITE_BALANCE,
                               {V4L2_CID_WHITE_BALANCE_TEMPERATURE});
  settings.automatic_or_number("focus", config.focus, V4L2_CID_FOCUS_AUTO,
                               {V4L2_CID_FOCUS_ABSOLUTE});
  return settings.report;
}

DeviceExposure read_exposure(Port& port) {
  DeviceExposure exposure;
  const auto mode = read_control(port, V4L2_CID_EXPOSURE_AUTO);
  exposure.is_automatic = mode == V4L2_EXPOSURE_AUTO || mode == V4L2_EXPOSURE_APERTURE_PRIORITY;
  if (const auto units = read_control(port, V4L2_CID_EXPOSURE_ABSOLUTE)) {
    if (*units > 0) exposure.time = from_seconds(*units * kExposureUnit_s);
    return exposure;
  }
  exposure.is_in_lines = read_control(port, V4L2_CID_EXPOSURE).has_value();
  return exposure;
}

}  // namespace fiducap::v4l2
