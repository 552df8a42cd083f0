#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/config/body_config.hpp"
#include "daemon/setup/setup_rig.hpp"
#include "detection/detector_config.hpp"

namespace fiducap {

/// Result of a set-up, for the configuration.
struct SetupResult {
  std::string body{"robot"};
  TagSetConfig tags;
  /// Source (none: `simulated` gives the images), lens and pose as far as known.
  CameraConfig camera;
  std::string lens_from;   ///< For a comment, e.g. `31 views, fit to 0.21 px`; empty: a guess.
  std::string mount_from;  ///< The same for the pose of the camera and its clock.
  std::optional<simulation::SimulatedBodyConfig> simulated;  ///< Camera and IMU in one.
  simulation::RoomConfig room;                               ///< Of a simulated robot.
  std::optional<ImuSourceConfig> imu_source;  ///< Its own; nullopt: none, or of `simulated`.
  std::optional<ImuNoise> imu;                ///< nullopt: there is none.
  std::string imu_from;
};

/// The cameras of this machine.
[[nodiscard]] std::vector<FoundCamera> found_cameras();

/// File of the operator's token, beside the configuration: `robot.yaml` → `robot.token`.
[[nodiscard]] std::string token_file_of(const std::string& file);

/// The tags of a set-up, to be printed: PDF. @param order  `family`, `size_mm`, `paper`
[[nodiscard]] Expected<std::string> setup_sheet(const SetupCommand& order);

/// The content of write_setup: with comments; keys that are not set have their defaults.
[[nodiscard]] std::string setup_preview(const std::string& file, const SetupResult& result);

/// Whether it could be written there.
[[nodiscard]] Expected<void> can_write_setup(const std::string& file);

/// Writes the configuration, and a new operator's token beside it that only this user may read.
/// Both atomically.
/// @param replace  overwrites an existing file
/// @return Error when there is one, or the result breaks a rule of configurations
[[nodiscard]] Expected<void> write_setup(const std::string& file, const SetupResult& result,
                                         bool replace);

}  // namespace fiducap
