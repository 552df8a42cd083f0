#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "capture/camera_device.hpp"
#include "capture/imu/imu_source_config.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/recording/recording.hpp"
#include "capture/ros/ros_config.hpp"
#include "capture/sensor_source.hpp"
#include "pipeline/body_tracker.hpp"
#include "simulation/simulation.hpp"

namespace fiducap {

enum class SourceType { kSimulator, kRecording, kCamera, kRos, kSensors };

/// Every sensor has a source of its own (CameraConfig::source, BodyConfig::imu_source).
struct SensorsConfig {};

template <class V>
void describe(V&, SensorsConfig&) {}

[[nodiscard]] std::vector<ConfigError> check_source(const SensorsConfig& config,
                                                    const SourceSurroundings& around,
                                                    const std::string& body_prefix);

enum class CameraSourceType { kCamera, kRos };

/// Source of the images of one camera.
struct CameraSourceConfig {
  CameraSourceType type{CameraSourceType::kCamera};
  CameraDeviceConfig camera;
  dds::RosCameraConfig ros;

  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const {
    return type == CameraSourceType::kRos ? ros.check(prefix) : camera.check(prefix);
  }
};

/// Source of a body's samples. `type` selects one of the others, whose keys are directly below
/// `source` in the file.
struct SourceConfig {
  SourceType type{SourceType::kSimulator};
  simulation::SimulatedBodyConfig simulator;  ///< `cameras` empty: true cameras as configured.
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

/// Calls `visit` with the configuration of the selected source. Each kind has its struct,
/// `describe` (keys) and `check_source` (rules) in its own folder, and is opened in
/// `bodies/body_setup.cpp`.
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

/// `type` is first, because it decides which other keys there are.
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

struct CameraConfig {
  /// Kalibr camchain (lens, pose, time) or a calibration file of one camera (lens only).
  std::string calibration{};
  CameraMount mount = calibrated_mount();      ///< What is not in `calibration`.
  std::optional<CameraSourceConfig> source{};  ///< Its own; without it: the body's `source`.
};

/// Whether its source, or the body's, may provide the lens of the camera when it is open.
inline bool provides_lens(const SourceConfig& source, const CameraConfig& camera) {
  if (camera.source) return camera.source->type == CameraSourceType::kRos;
  return visit_source(source, [](const auto& config) {
    return requires { config.kProvidesLenses; };
  });
}

/// Noise of an IMU, or the name of a part whose noise is known.
struct ImuConfig : ImuNoise {
  /// Name of a chip, camera or autopilot, e.g. `bmi088`; other keys override its values.
  std::string part;
};

struct BodyConfig {
  std::string name;             ///< In all protocols and in the folders of recordings.
  int id{0};                    ///< In all protocols; 0: place in the list, from 1.
  std::string filter{"world"};  ///< `world`, or `robocentric` (RCARS; needs an IMU).
  /// `type: sensors` if `cameras` and `imu_source` have sources of their own.
  SourceConfig source;
  std::vector<CameraConfig> cameras;            ///< Empty with a recording: the recording's own.
  std::optional<ImuSourceConfig> imu_source{};  ///< Its own; without it: the body's `source`.
  bool use_imu{true};                           ///< False: readings of an IMU are not used.
  std::string kalibr_imu;                       ///< Kalibr imu.yaml; overrides `imu`.
  std::string imu_correction;    ///< Of `fiducap calibrate imu --poses`; empty: none.
  std::optional<ImuConfig> imu;  ///< Without it: the noise that recording or simulator state.
  Pose pivot;                    ///< X_BP: the published point and axes.
  BodyLimits limits;
};

}  // namespace fiducap
