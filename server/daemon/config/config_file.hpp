#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/gravity.hpp"
#include "base/log.hpp"
#include "base/pose.hpp"
#include "capture/imu/imu_source_config.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/calibrated_mount.hpp"
#include "daemon/config/source_config.hpp"
#include "daemon/operator_token.hpp"
#include "daemon/recording/session_recorder.hpp"
#include "detection/detector_config.hpp"
#include "estimation/estimator_config.hpp"
#include "mapping/map_builder.hpp"
#include "middleware/network.hpp"
#include "pipeline/body_tracker.hpp"
#include "simulation/simulation.hpp"
#include "streaming/protocol_configs.hpp"

namespace fiducap {

struct CameraConfig {
  std::string calibration{};  ///< Kalibr camchain (lens, place, time) or a calibration file of one
                              ///< camera (lens only).
  CameraMount mount = calibrated_mount();      ///< What `calibration` does not say.
  std::optional<CameraSourceConfig> source{};  ///< Its own; nullopt: the body's.
};

/// An inertial unit: its noise, or the part that it is, whose noise is looked up.
struct ImuConfig : ImuNoise {
  std::string part;  ///< See `part_names`; keys beside it go before the table.
};

struct BodyConfig {
  std::string name;
  int id{0};  ///< Streaming id; 0: place in the list, from 1.
  std::string filter{"world"};
  SourceConfig source;                ///< kSensors, where only `cameras` and the IMU name sources.
  std::vector<CameraConfig> cameras;  ///< Empty with a recording: the recording's own.
  std::optional<ImuSourceConfig> imu_source{};  ///< Its own; nullopt: the body's.
  bool use_imu{true};                           ///< False: the IMU is not listened to.
  std::string kalibr_imu;                       ///< Kalibr imu.yaml; goes before `imu`.
  std::string imu_correction;    ///< Of `fiducap calibrate imu --poses`; empty: none.
  std::optional<ImuConfig> imu;  ///< nullopt: the recording's or the simulator's own.
  Pose pivot;                    ///< X_BP: what is streamed, in body axes.
  BodyLimits limits;
};

struct MapSettings {
  MapConfig builder;
  std::string store;  ///< SQLite file; empty: the map is forgotten at the end.
  std::string file;   ///< Surveyed start for an empty store: our YAML, csv or WPILib json.
  double file_tag_size_m{0.1651};      ///< WPILib files do not carry sizes.
  std::optional<int> reference_tag;    ///< WorkspaceGauge
  std::optional<Pose> reference_pose;  ///< X_WT of the reference tag.
  std::vector<int> floor_tags;         ///< WorkspaceGauge
  /// Start from what was learned about the cameras and stored beside the map.
  bool use_learned_extrinsics{true};
  /// What the map corrects about a body, where it is refined (`refine_period_s`) or an operator
  /// goes back to another version, is published over so many seconds, longer where a frame would
  /// move by a sigma otherwise; 0: at once.
  double correction_ramp_s{2.0};
};

/// What all protocols share, and a section for each of them.
struct StreamingConfig : ProtocolConfigs {
  double rate_hz{100.0};
  std::vector<std::string>
      optional;  ///< Protocols without which the server may run, e.g. when a port is taken.
};

/// Where on Earth the robots are: it decides how strong gravity is.
struct SiteConfig {
  std::optional<double> gravity_m_s2;  ///< As measured there …
  std::optional<double> latitude_deg;  ///< … or by a formula, with …
  double height_m{0};                  ///< … the height above sea level.

  /// nullopt: nothing is said.
  [[nodiscard]] std::optional<double> told_gravity() const {
    if (gravity_m_s2 || !latitude_deg) return gravity_m_s2;
    return normal_gravity(*latitude_deg, height_m);
  }
  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// Everything `fiducapd` can be told. Defaults live here and in the rooms' structs, nowhere else.
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

/// Reads a configuration and checks it. Unknown keys, wrong types and broken rules are reported all
/// at once.
///
/// Relative paths in the file are relative to the file, those of `sets` to the working directory;
/// `~` and environment variables are not expanded. Files that the configuration names are not
/// opened here (see body_sensors.hpp).
/// @param file  empty: defaults and `sets` only
/// @param sets  `path.to.key=value`, value in YAML, list entries by number:
/// `bodies.0.source.folder=x`
[[nodiscard]] ConfigResult<ServerConfig> load_config(const std::string& file,
                                                     const std::vector<std::string>& sets = {});

/// The same for text that is already there. @param name  stands in messages; its folder is the base
/// of relative paths
[[nodiscard]] ConfigResult<ServerConfig> parse_config(const std::string& text,
                                                      const std::string& name,
                                                      const std::vector<std::string>& sets = {});

/// The effective configuration as YAML: every key, paths resolved. Loads again to the same,
/// but without secrets.
[[nodiscard]] std::string print_config(const ServerConfig& config);

/// The rules of all rooms and those between them, e.g. that names are unique.
[[nodiscard]] std::vector<ConfigError> check(const ServerConfig& config);

}  // namespace fiducap
