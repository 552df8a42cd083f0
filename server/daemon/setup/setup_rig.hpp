#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/camera_device.hpp"
#include "capture/imu/imu_source_config.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/sensor_source.hpp"
#include "simulation/simulation.hpp"

namespace fiducap {

/// The steps from no camera to a configuration, in their order.
enum class SetupStep {
  kCamera,   ///< Which one?
  kPicture,  ///< Exposed and in focus?
  kSheet,    ///< Tags on paper, measured.
  kLens,     ///< Images of the sheet, until the lens is known.
  kImu,      ///< Which one, if any?
  kRest,     ///< Its noise, at rest.
  kMount,    ///< Rough pose of the camera on the robot.
  kWave,     ///< Exact pose, and the camera's clock.
  kFinish,   ///< The configuration, to be read and written.
};

/// A command of the page, e.g. `camera` with `open`.
struct SetupCommand {
  std::string what;
  std::map<std::string, std::string> values{};

  [[nodiscard]] std::string text(const std::string& key) const;
  /// @return nullopt: missing, or not a number
  [[nodiscard]] std::optional<double> number(const std::string& key) const;
};

struct FoundCamera {
  std::string open;     ///< CameraDeviceConfig::open.
  std::string name;     ///< For the user.
  std::string problem;  ///< Why it cannot be opened; empty: it can.
};

/// The sensors of a set-up. Their samples go to SetupGuide::take.
class SetupRig {
 public:
  virtual ~SetupRig() = default;
  [[nodiscard]] virtual std::vector<FoundCamera> cameras() = 0;
  /// Closes the camera before and opens this one. Its images follow.
  virtual Expected<void> use(const CameraDeviceConfig& camera) = 0;
  /// The same for the IMU, which is another source than the camera.
  virtual Expected<void> use(const ImuSourceConfig& imu) = 0;
  virtual void close_imu() = 0;
  /// A simulated robot moves as the step requires.
  virtual void begin(SetupStep step) = 0;
  /// The simulated robot (camera and IMU) in use; nullopt: another camera.
  [[nodiscard]] virtual std::optional<simulation::SimulatedBodyConfig> simulated() const = 0;
};

/// A simulated robot for a set-up: views a sheet from all sides, rests, is waved in front of tags.
class SimulatedRig final {
 public:
  /// CameraDeviceConfig::open of its camera.
  static constexpr const char* kName = "simulated";

  /// @param clock  paces the samples; nullptr: as fast as possible
  explicit SimulatedRig(const Clock* clock);

  /// Camera and IMU. The rig outlives it.
  [[nodiscard]] OpenedSource open();
  void begin(SetupStep step);
  /// Its configuration after the set-up.
  [[nodiscard]] simulation::SimulatedBodyConfig body() const;
  [[nodiscard]] static simulation::RoomConfig room();

 private:
  class Motion;

  const Clock* clock_;
  std::shared_ptr<std::atomic<SetupStep>> step_;
};

}  // namespace fiducap
