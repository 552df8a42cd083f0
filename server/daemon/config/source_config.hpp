#pragma once

#include <array>
#include <string_view>

#include "base/config_check.hpp"
#include "capture/camera_device.hpp"
#include "capture/recording/recording.hpp"
#include "capture/ros/ros_config.hpp"
#include "simulation/simulation_config.hpp"

namespace fiducap {

enum class SourceType { kSimulator, kRecording, kCamera, kRos };

/// Where a body's samples come from. `type` decides which of the four is read; in the file their
/// keys stand directly below `source`.
struct SourceConfig {
  SourceType type{SourceType::kSimulator};
  simulation::SimulatedBodyConfig
      simulator;  ///< `cameras` empty: the truth is what the body believes.
  RecordingSourceConfig recording;
  CameraDeviceConfig camera;
  dds::RosSourceConfig ros;
};

namespace words {
inline constexpr std::array<Word<SourceType>, 4> kSourceType{{{"simulator", SourceType::kSimulator},
                                                              {"recording", SourceType::kRecording},
                                                              {"camera", SourceType::kCamera},
                                                              {"ros", SourceType::kRos}}};
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

}  // namespace fiducap
