#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "capture/camera_device.hpp"
#include "capture/v4l2/device.hpp"

namespace fiducap::v4l2 {

/// A setting of a device: exposure, gain, …
struct Control {
  std::uint32_t id{};
  std::string name{};
  std::int32_t minimum{};
  std::int32_t maximum{};
  std::int32_t step{1};
  std::int32_t usual{};                 ///< Default of the driver.
  std::optional<std::int32_t> value{};  ///< nullopt: not readable.
  bool may_be_set{};                    ///< False also while an automatic mode sets it.
  bool is_yes_or_no{};
  std::vector<std::pair<std::int32_t, std::string>> choices{};  ///< Of a menu.

  [[nodiscard]] bool offers(std::int32_t wanted) const {
    if (choices.empty()) return wanted >= minimum && wanted <= maximum;
    return std::ranges::any_of(choices,
                               [wanted](const auto& choice) { return choice.first == wanted; });
  }
};

/// All numbers, menus and switches of the device; bounded.
[[nodiscard]] std::vector<Control> controls(Port& port);
[[nodiscard]] std::optional<Control> control_of(Port& port, std::uint32_t id);
/// The first whose name contains `part`, ignoring case. @param part  in lower case
[[nodiscard]] std::optional<Control> control_named(Port& port, std::string_view part);

[[nodiscard]] std::optional<std::int32_t> read_control(Port& port, std::uint32_t id);
/// @return the value read back; nullopt: refused, or not readable
std::optional<std::int32_t> set_control(Port& port, std::uint32_t id, std::int32_t value);

/// The result of settings, as messages.
struct SettingsReport {
  std::vector<std::string> done;    ///< `gain 12`
  std::vector<std::string> undone;  ///< Requested value, actual value and reason.
};

/// Applies the configured settings and reads them back. Again after the start: some devices forget.
[[nodiscard]] SettingsReport apply_settings(Port& port, const CameraDeviceConfig& config);

struct DeviceExposure {
  std::optional<Duration> time{};
  bool is_in_lines{};  ///< In lines of the sensor, which cannot be converted.
  bool is_automatic{};
};

[[nodiscard]] DeviceExposure read_exposure(Port& port);

}  // namespace fiducap::v4l2
