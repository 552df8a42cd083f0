#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_check.hpp"
#include "capture/camera_device.hpp"
#include "capture/recording/recording.hpp"
#include "capture/ros/ros_config.hpp"
#include "capture/source_surroundings.hpp"
#include "simulation/simulation_config.hpp"

namespace fiducap {

enum class SourceType { kSimulator, kRecording, kCamera, kRos, kSensors };

/// Every camera and the IMU has a source of its own (CameraConfig::source,
/// BodyConfig::imu_source).
struct SensorsConfig {};

template <class V>
void describe(V&, SensorsConfig&) {}

[[nodiscard]] std::vector<ConfigError> check_source(const SensorsConfig& config,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

enum class CameraSourceType { kCamera, kRos };

/// Where the images of one camera come from.
struct CameraSourceConfig {
  CameraSourceType type{CameraSourceType::kCamera};
  CameraDeviceConfig camera;
  dds::RosCameraConfig ros;

  [[nodiscard]] bool tells_lens() const { return type == CameraSourceType::kRos; }
  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const {
    return type == CameraSourceType::kRos ? ros.check(prefix) : camera.check(prefix);
  }
};

/// Where a body's samples come from. `type` decides which of the others is read; in the file their
/// keys stand directly below `source`.
struct SourceConfig {
  SourceType type{SourceType::kSimulator};
  simulation::SimulatedBodyConfig
      simulator;  ///< `cameras` empty: the truth is what the body believes.
  RecordingSourceConfig recording;
  CameraDeviceConfig camera;
  dds::RosSourceConfig ros;
  SensorsConfig sensors;
};

namespace words {
inline constexpr std::array<Word<SourceType>, 5> kSourceType{{{"simulator", SourceType::kSimulator},
                                                              {"recording", SourceType::kRecording},
                                                              {"camera", SourceType::kCamera},
                                                              {"ros", SourceType::kRos},
                                                              {"sensors", SourceType::kSensors}}};
inline constexpr std::array<Word<CameraSourceType>, 2> kCameraSourceType{
    {{"camera", CameraSourceType::kCamera}, {"ros", CameraSourceType::kRos}}};
}  // namespace words

/// The registry of sources: calls `visit` with the configuration of the one that was chosen. What
/// it has of its own, in its own folder: the struct, `describe` (its keys) and `check_source` (its
/// rules); how it is opened stands in `bodies/body_sources.cpp`.
template <class Config, class Visit>
decltype(auto) visit_source(Config& source, Visit&& visit) {
  switch (source.type) {
    case SourceType::kRecording:
      return visit(source.recording);
    case SourceType::kCamera:
      return visit(source.camera);
    case SourceType::kRos:
      return visit(source.ros);
    case SourceType::kSensors:
      return visit(source.sensors);
    case SourceType::kSimulator:
      break;
  }
  return visit(source.simulator);
}

/// Whether the source itself may tell the lenses of its cameras, once it is open.
inline bool tells_lenses(const SourceConfig& source) {
  return visit_source(source, [](const auto& config) {
    return requires { config.kTellsLenses; };
  });
}

/// `type` comes first: it decides which other keys there are.
template <class V>
void describe(V& v, SourceConfig& c) {
  v.word("type", c.type, words::kSourceType);
  visit_source(c, [&v](auto& source) { describe(v, source); });
}

template <class V>
void describe(V& v, CameraSourceConfig& c) {
  v.word("type", c.type, words::kCameraSourceType);
  if (c.type == CameraSourceType::kRos) {
    describe(v, c.ros);
  } else {
    describe(v, c.camera);
  }
}

}  // namespace fiducap
