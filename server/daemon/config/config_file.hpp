#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/gravity.hpp"
#include "base/log.hpp"
#include "base/pose.hpp"
#include "daemon/config/body_config.hpp"
#include "daemon/operator_token.hpp"
#include "daemon/recording/session_recorder.hpp"
#include "detection/detector_config.hpp"
#include "estimation/estimator_config.hpp"
#include "mapping/map_builder.hpp"
#include "middleware/network.hpp"
#include "streaming/protocols.hpp"

namespace fiducap {

struct MapSettings {
  MapConfig builder;
  std::string store;  ///< SQLite file; empty: the map is not stored.
  std::string file;   ///< Surveyed start for an empty store: own YAML, csv or WPILib json.
  double file_tag_size_m{0.1651};      ///< WPILib files do not carry sizes.
  std::optional<int> reference_tag;    ///< Defines the origin; without it: the first tag seen.
  std::optional<Pose> reference_pose;  ///< X_WT of the reference tag.
  /// Tags that lie flat, face up: bodies without IMU wait for all, and take the vertical from them.
  std::vector<int> floor_tags;
  /// Start from the cameras estimated in earlier sessions, stored beside the map.
  bool use_learned_extrinsics{true};
  /// Duration over which corrections of the map (`refine_period_s`, rollbacks) reach clients;
  /// longer where a frame would move by a sigma otherwise; 0: at once.
  double correction_ramp_s{2.0};
};

/// A section for each protocol, and what they share.
struct StreamingConfig : ProtocolConfigs {
  double rate_hz{100.0};  ///< Frames per second to all clients; some protocols have lower limits.
  /// Protocols without which the server may run, e.g. when a port is taken.
  std::vector<std::string> optional;

  [[nodiscard]] bool is_optional(std::string_view protocol) const {
    return std::ranges::find(optional, protocol) != optional.end();
  }
};

/// Gravity at the site of the robots.
struct SiteConfig {
  std::optional<double> gravity_m_s2;  ///< Measured …
  std::optional<double> latitude_deg;  ///< … or by a formula, with …
  double height_m{0};                  ///< … the height above sea level.

  /// nullopt: not configured.
  [[nodiscard]] std::optional<double> configured_gravity() const {
    if (gravity_m_s2 || !latitude_deg) return gravity_m_s2;
    return normal_gravity(*latitude_deg, height_m);
  }
  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// The whole configuration of `fiducapd`. Defaults are here and in the modules' structs only.
struct ServerConfig {
  log::Level log_level{log::Level::kInfo};
  SiteConfig site;
  TagSetConfig tags;
  DetectorConfig detector;
  EstimatorConfig estimator;
  MapSettings map;
  simulation::RoomConfig simulation;
  std::vector<BodyConfig> bodies;
  StreamingConfig streaming;
  dds::NetworkConfig dds;  ///< For ROS 2 in both directions.
  OperatorConfig operators;
  RecorderConfig recorder;
};

template <typename T>
using ConfigResult = tl::expected<T, std::vector<ConfigFault>>;

/// Reads and checks a configuration. All unknown keys, wrong types and broken rules are reported at
/// once.
///
/// Relative paths in the file are relative to the file, those of `sets` to the working directory;
/// `~` and environment variables are not expanded. Files that the configuration names are not
/// opened here (see body_setup.hpp).
/// @param file  empty: defaults and `sets` only
/// @param sets  `path.to.key=value`, value in YAML, list entries by number:
/// `bodies.0.source.folder=x`
[[nodiscard]] ConfigResult<ServerConfig> load_config(const std::string& file,
                                                     const std::vector<std::string>& sets = {});

/// The same for a text. @param name  for messages; its folder is the base of relative paths
[[nodiscard]] ConfigResult<ServerConfig> parse_config(const std::string& text,
                                                      const std::string& name,
                                                      const std::vector<std::string>& sets = {});

/// The effective configuration as YAML: every key, paths resolved. Loads again to the same,
/// but without secrets.
[[nodiscard]] std::string print_config(const ServerConfig& config);

/// The rules of all modules and those between them, e.g. that names are unique.
[[nodiscard]] std::vector<ConfigError> check(const ServerConfig& config);

}  // namespace fiducap
