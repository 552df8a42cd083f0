#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "capture/v4l2/controls.hpp"
#include "capture/v4l2/device.hpp"

namespace fiducap {

struct ListedCamera {
  std::string device;           ///< `/dev/video0`
  std::string lasting_name;     ///< `/dev/v4l/by-id/…`, stable over restarts; empty: none.
  std::string name;             ///< In the kernel.
  std::optional<Error> closed;  ///< Reason why nothing more is known.
  v4l2::Identity identity;
  std::vector<v4l2::OfferedFormat> formats;
  std::vector<v4l2::Control> controls;
  std::optional<v4l2::Mode> now;

  /// Its name in a configuration.
  [[nodiscard]] const std::string& open() const {
    return lasting_name.empty() ? device : lasting_name;
  }
};

/// Folders that are searched for devices; others in tests.
struct CameraPlaces {
  std::filesystem::path devices{"/dev"};
  std::filesystem::path names{"/sys/class/video4linux"};
  std::function<Expected<std::unique_ptr<v4l2::Port>>(const std::string&)> open{v4l2::open_port};
};

/// Cameras by number, also those that may not be opened. Running ones are not disturbed.
[[nodiscard]] std::vector<ListedCamera> list_cameras(const CameraPlaces& places);

/// A good initial mode: the largest size up to a megapixel at its highest rate, if that is 25 Hz or
/// more; else the fastest. nullopt: no supported format.
struct SuggestedMode {
  std::string format;
  PixelSize size{};
  double rate_hz{};  ///< 0: not known.
};
[[nodiscard]] std::optional<SuggestedMode> suggest_mode(const ListedCamera& camera);

/// Section `source:` of a body, for a configuration.
[[nodiscard]] std::string source_section(const ListedCamera& camera);

}  // namespace fiducap
