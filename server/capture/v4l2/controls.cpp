#include "capture/v4l2/controls.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>

#include <linux/videodev2.h>

#include "base/text.hpp"

namespace fiducap::v4l2 {
namespace {

constexpr std::size_t kMostControls = 256;
constexpr std::int32_t kMostChoices = 64;

std::vector<std::pair<std::int32_t, std::string>> choices_of(Port& port,
                                                             const v4l2_queryctrl& query) {
  std::vector<std::pair<std::int32_t, std::string>> choices;
  const std::int32_t first = std::max(query.minimum, 0);
  for (std::int32_t i = first; i <= std::min(query.maximum, first + kMostChoices); ++i) {
    v4l2_querymenu entry{};
    entry.id = query.id;
    entry.index = static_cast<std::uint32_t>(i);
    if (port.control(VIDIOC_QUERYMENU, &entry) != 0) continue;  // menus have holes
    choices.emplace_back(i, query.type == V4L2_CTRL_TYPE_MENU ? text_of_field(entry.name)
                                                              : std::to_string(entry.value));
  }
  return choices;
}

/// nullopt: not a single number, or disabled.
std::optional<Control> described(Port& port, const v4l2_queryctrl& query) {
  const bool is_menu =
      query.type == V4L2_CTRL_TYPE_MENU || query.type == V4L2_CTRL_TYPE_INTEGER_MENU;
  const bool is_one_number =
      is_menu || query.type == V4L2_CTRL_TYPE_INTEGER || query.type == V4L2_CTRL_TYPE_BOOLEAN;
  if (!is_one_number || (query.flags & V4L2_CTRL_FLAG_DISABLED) != 0) return std::nullopt;
  Control control;
  control.id = query.id;
  control.name = text_of_field(query.name);
  control.minimum = query.minimum;
  control.maximum = query.maximum;
  control.step = query.step;
  control.usual = query.default_value;
  control.may_be_set = (query.flags & (V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_INACTIVE)) == 0;
  control.is_yes_or_no = query.type == V4L2_CTRL_TYPE_BOOLEAN;
  if (is_menu) control.choices = choices_of(port, query);
  if ((query.flags & V4L2_CTRL_FLAG_WRITE_ONLY) == 0) control.value = read_control(port, query.id);
  return control;
}

using Kind = ControlSetting::Kind;

constexpr double kExposureUnit_s = 1e-4;  // of V4L2_CID_EXPOSURE_ABSOLUTE

std::string value_text(const Control& control, std::int32_t value) {
  for (const auto& [number, text] : control.choices)
    if (number == value) return std::to_string(value) + " (" + text + ")";
  return std::to_string(value);
}

std::string range_text(const Control& control) {
  if (control.choices.empty())
    return std::to_string(control.minimum) + " to " + std::to_string(control.maximum);
  return comma_list(control.choices,
                    [&control](const auto& choice) { return value_text(control, choice.first); });
}

/// In seconds: 0.008
std::string exposure_text(std::int32_t units) {
  std::string text = fixed(units * kExposureUnit_s, 4);
  while (text.ends_with('0') && !text.ends_with(".0")) text.pop_back();
  return text;
}

/// The first one that the device has.
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

  /// @param automatic  switch of the automatic mode; @param manual  controls of the number
  void automatic_or_number(const char* key, const std::string& text, std::uint32_t automatic,
                           std::initializer_list<std::uint32_t> manual) {
    const ControlSetting setting = parse_control_setting(text).value_or(ControlSetting{});
    if (setting.kind == Kind::kAsIs) return;
    const auto on = control_of(port_, automatic);
    if (setting.kind == Kind::kAuto) {
      if (!on) return report_missing(key, "auto", "it has no automatic mode for it");
      return set(key, *on, 1, "auto");
    }
    if (on && on->value != 0) (void)set_control(port_, automatic, 0);
    const auto number = first_control(port_, manual);
    if (!number) return report_missing(key, text, "it has no such control");
    set(key, *number, setting.number, text);
  }

  void trigger(const std::string& text) {
    const ControlSetting setting = parse_control_setting(text).value_or(ControlSetting{});
    if (setting.kind == Kind::kAsIs) return;
    const auto control = control_named(port_, "trigger");
    if (!control)
      return report_missing("trigger", text, "none of its controls has \"trigger\" in its name");
    set("trigger", *control,
        setting.kind == Kind::kNumber ? setting.number : setting.kind == Kind::kOn, text);
  }

  void power_line(const std::string& text) {
    if (text == "as_is") return;
    const auto control = control_of(port_, V4L2_CID_POWER_LINE_FREQUENCY);
    if (!control) return report_missing("power_line", text, "it has no such control");
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
    if (!mode) return report_missing("exposure", "auto", "it has no automatic mode for it");
    // Where a camera has both, "auto" also moves the iris.
    const std::int32_t value =
        mode->offers(V4L2_EXPOSURE_AUTO) ? V4L2_EXPOSURE_AUTO : V4L2_EXPOSURE_APERTURE_PRIORITY;
    set("exposure", *mode, value, "auto");
    if (control_of(port_, V4L2_CID_EXPOSURE_AUTO_PRIORITY))
      (void)set_control(port_, V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0);  // no longer than its rate
  }

  void manual_exposure(double exposure_s) {
    const std::string requested = shortest(exposure_s);
    if (const auto mode = control_of(port_, V4L2_CID_EXPOSURE_AUTO)) {
      const std::int32_t value = mode->offers(V4L2_EXPOSURE_MANUAL)
                                     ? V4L2_EXPOSURE_MANUAL
                                     : V4L2_EXPOSURE_SHUTTER_PRIORITY;
      if (mode->value != value) (void)set_control(port_, mode->id, value);
    }
    const auto time = control_of(port_, V4L2_CID_EXPOSURE_ABSOLUTE);
    if (!time) {
      const bool in_lines = control_of(port_, V4L2_CID_EXPOSURE).has_value();
      return report_missing("exposure_s", requested,
                            in_lines
                                ? "its exposure is in lines of the sensor, not in time: set it "
                                  "with v4l2-ctl, and configure the resulting time here"
                                : "its exposure cannot be set: this value is assumed");
    }
    const double units = std::clamp(exposure_s / kExposureUnit_s, 0.0, 1e9);
    const auto wanted =
        std::clamp(static_cast<std::int32_t>(std::lround(units)), time->minimum, time->maximum);
    const auto is = set_control(port_, time->id, wanted);
    if (!is) return report_missing("exposure_s", requested, "it refused");
    const double is_s = *is * kExposureUnit_s;
    constexpr double kSame_s = kExposureUnit_s;  // its resolution
    if (std::abs(is_s - exposure_s) <= kSame_s) {
      report.done.push_back("exposure_s " + exposure_text(*is));
    } else {
      report.undone.push_back("exposure_s is " + exposure_text(*is) + ", not " + requested +
                              " as requested: the range is " + exposure_text(time->minimum) +
                              " to " + exposure_text(time->maximum));
    }
  }

  void set(const char* key, const Control& control, std::int32_t wanted,
           const std::string& requested) {
    const auto is = set_control(port_, control.id, wanted);
    if (is == wanted) return report.done.push_back(std::string(key) + " " + requested);
    const std::string instead = is              ? value_text(control, *is)
                                : control.value ? value_text(control, *control.value)
                                                : "?";
    report.undone.push_back(std::string(key) + " is " + instead + ", not " + requested +
                            " as requested: its control \"" + control.name + "\" accepts " +
                            range_text(control));
  }

  void report_missing(const char* key, const std::string& requested, const char* why) {
    report.undone.push_back(std::string(key) + " " + requested + " was requested, but " + why);
  }

  Port& port_;
};

}  // namespace

std::vector<Control> controls(Port& port) {
  std::vector<Control> found;
  v4l2_queryctrl query{};
  std::uint32_t last = 0;
  for (std::size_t i = 0; i < kMostControls; ++i) {
    query = {};
    query.id = last | V4L2_CTRL_FLAG_NEXT_CTRL;
    if (port.control(VIDIOC_QUERYCTRL, &query) != 0 || query.id <= last) break;
    last = query.id;
    if (auto control = described(port, query)) found.push_back(std::move(*control));
  }
  return found;
}

std::optional<Control> control_of(Port& port, std::uint32_t id) {
  v4l2_queryctrl query{};
  query.id = id;
  if (port.control(VIDIOC_QUERYCTRL, &query) != 0) return std::nullopt;
  return described(port, query);
}

std::optional<Control> control_named(Port& port, std::string_view part) {
  const auto is_same = [](unsigned char a, char b) { return std::tolower(a) == b; };
  for (Control& control : controls(port)) {
    const std::string& name = control.name;
    if (std::search(name.begin(), name.end(), part.begin(), part.end(), is_same) != name.end())
      return std::move(control);
  }
  return std::nullopt;
}

std::optional<std::int32_t> read_control(Port& port, std::uint32_t id) {
  v4l2_control entry{id, 0};
  if (port.control(VIDIOC_G_CTRL, &entry) != 0) return std::nullopt;
  return entry.value;
}

std::optional<std::int32_t> set_control(Port& port, std::uint32_t id, std::int32_t value) {
  v4l2_control entry{id, value};
  if (port.control(VIDIOC_S_CTRL, &entry) != 0) return std::nullopt;
  return read_control(port, id);
}

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
