#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "capture/camera_device.hpp"
#include "capture/v4l2/v4l2_port.hpp"

namespace fiducap::v4l2 {

/// What a device made of the settings it was asked for, in words.
struct SettingsReport {
  std::vector<std::string> done;    ///< `gain 12`
  std::vector<std::string> undone;  ///< What was asked, what it is instead, and why.
};

/// Sets what the configuration asks for, and reads it back. Again and again if need be: some
/// devices forget when their stream starts.
[[nodiscard]] SettingsReport apply_settings(Port& port, const CameraDeviceConfig& config);

/// How long the device says that it exposes.
struct DeviceExposure {
  std::optional<Duration> time{};
  bool is_in_lines{};  ///< It counts in lines of its sensor, which nobody here can translate.
  bool is_automatic{};
};

[[nodiscard]] DeviceExposure read_exposure(Port& port);

}  // namespace fiducap::v4l2
