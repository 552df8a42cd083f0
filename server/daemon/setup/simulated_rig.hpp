#pragma once

#include <atomic>
#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/sensor_source.hpp"
#include "daemon/setup/setup_rig.hpp"
#include "simulation/simulation.hpp"

namespace fiducap {

/// A simulated robot that does what a person would do with a real one in each step of a set-up: it
/// looks at a sheet from everywhere, lies still, is waved before tags.
class SimulatedRig final {
 public:
  /// CameraDeviceConfig::open of its camera.
  static constexpr const char* kName = "simulated";

  /// @param clock  samples come when they are due on it; nullptr: as fast as they are asked for
  explicit SimulatedRig(const Clock* clock);

  /// Camera and IMU. Follows this rig, which outlives it.
  [[nodiscard]] Expected<std::unique_ptr<SensorSource>> open();
  void begin(SetupStep step);
  /// As it is configured after the set-up: it walks through the room then.
  [[nodiscard]] simulation::SimulatedBodyConfig body() const;
  [[nodiscard]] static simulation::RoomConfig room();

 private:
  class Motion;

  const Clock* clock_;
  std::shared_ptr<std::atomic<SetupStep>> step_;
};

}  // namespace fiducap
