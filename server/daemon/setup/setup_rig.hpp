#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/camera_device.hpp"
#include "capture/lens/camera_model.hpp"
#include "simulation/simulation_config.hpp"

namespace fiducap {

/// The steps from no camera to a configuration, in their order.
enum class SetupStep {
  kCamera,   ///< Which one?
  kPicture,  ///< Exposed and in focus?
  kSheet,    ///< Tags on paper, measured.
  kLens,     ///< Pictures of the sheet, until the lens is known.
  kImu,      ///< Which one, if any?
  kRest,     ///< It lies still: its noise.
  kMount,    ///< Roughly, where the camera sits on the robot.
  kWave,     ///< Exactly, and the camera's clock.
  kFinish,   ///< The configuration, to be read and written.
};

struct FoundCamera {
  std::string open;     ///< CameraDeviceConfig::open.
  std::string name;     ///< For people.
  std::string problem;  ///< Why it cannot be opened; empty: it can.
};

/// The sensors that a set-up works with. Their samples go to SetupGuide::take.
class SetupRig {
 public:
  virtual ~SetupRig() = default;
  [[nodiscard]] virtual std::vector<FoundCamera> cameras() = 0;
  /// Lets go of the camera before and opens this one. Its images follow.
  virtual Expected<void> use(const CameraDeviceConfig& camera) = 0;
  /// The same for the IMU, which is another source than the camera.
  virtual Expected<void> use(const ImuSourceConfig& imu) = 0;
  virtual void let_go_of_imu() = 0;
  /// What a person does now: a simulated robot does it by itself.
  virtual void begin(SetupStep step) = 0;
  /// A simulated robot, when the camera in use is its camera; it brings an IMU.
  [[nodiscard]] virtual std::optional<simulation::SimulatedBodyConfig> simulated() const = 0;
};

}  // namespace fiducap
