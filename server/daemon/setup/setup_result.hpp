#pragma once

#include <optional>
#include <string>

#include "daemon/config/config_file.hpp"

namespace fiducap {

/// What a set-up has found out: what becomes the configuration.
struct SetupResult {
  std::string body{"robot"};
  TagSetConfig tags;
  /// Its source (none: `simulated` gives the images), and lens and place as far as they are known.
  CameraConfig camera;
  std::string lens_from;   ///< For a comment, e.g. `31 views, fit to 0.21 px`; empty: a guess.
  std::string mount_from;  ///< The same of where the camera sits and of its clock.
  std::optional<simulation::SimulatedBodyConfig> simulated;  ///< Camera and IMU in one.
  simulation::RoomConfig room;                               ///< Of a simulated robot.
  std::optional<ImuSourceConfig> imu_source;  ///< Its own; nullopt: none, or of `simulated`.
  std::optional<ImuNoise> imu;                ///< nullopt: there is none.
  std::string imu_from;
};

/// The configuration as a file that a person reads: what was found, with comments; everything else
/// has its default.
/// @param store, token_file  beside the file
[[nodiscard]] std::string setup_text(const SetupResult& result, const std::string& store,
                                     const std::string& token_file);

}  // namespace fiducap
