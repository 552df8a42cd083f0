#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "capture/v4l2/control.hpp"
#include "capture/v4l2/device.hpp"

namespace fiducap {

/// A video device of this computer, as far as it can be asked.
struct ListedCamera {
  std::string device;        ///< `/dev/video0`
  std::string lasting_name;  ///< `/dev/v4l/by-id/…`: the same after a restart; empty: it has none.
  std::string name;          ///< As the kernel calls it.
  std::optional<Error> closed;  ///< Why nothing more is known.
  v4l2::Identity identity;
  std::vector<v4l2::OfferedFormat> formats;
  std::vector<v4l2::Control> controls;
  std::optional<v4l2::Mode> now;

  /// What a configuration calls it.
  [[nodiscard]] const std::string& open() const {
    return lasting_name.empty() ? device : lasting_name;
  }
};

/// Where devices are looked for; another place for tests.
struct CameraPlaces {
  std::filesystem::path devices{"/dev"};
  std::filesystem::path names{"/sys/class/video4linux"};
  std::function<Expected<std::unique_ptr<v4l2::Port>>(const std::string&)> open{v4l2::open_port};
};

/// Those that give images, in order of their numbers, and those that may not be opened; nodes for
/// metadata, outputs and codecs are left out. Images of a camera that runs are not disturbed.
[[nodiscard]] std::vector<ListedCamera> list_cameras(const CameraPlaces& places);

/// A good mode to begin with: the largest size up to a megapixel at its highest rate, if that is
/// 25 Hz or more; else the quickest. nullopt: nothing that we read.
struct SuggestedMode {
  std::string format;
  PixelSize size{};
  double rate_hz{};  ///< 0: it does not say.
};
[[nodiscard]] std::optional<SuggestedMode> suggest_mode(const ListedCamera& camera);

/// `source:` of a body, to be pasted into a configuration.
[[nodiscard]] std::string source_section(const ListedCamera& camera);

}  // namespace fiducap
