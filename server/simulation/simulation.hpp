#pragma once

#include <memory>
#include <vector>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sensor_source.hpp"
#include "simulation/simulation_config.hpp"

namespace fiducap::simulation {

/// The room's tags, true poses, sorted by id.
[[nodiscard]] std::vector<RecordedTag> tags_of(const RoomConfig& room);

/// The true motion of a robot: position, attitude and their derivatives at any time since start.
class Trajectory {
 public:
  struct Point {
    Pose X_WB;
    Eigen::Vector3d v_WB;    ///< m/s, W axes
    Eigen::Vector3d a_WB;    ///< m/s², W axes
    Eigen::Vector3d w_WB_B;  ///< rad/s, B axes
  };
  virtual ~Trajectory() = default;
  [[nodiscard]] virtual Point at(double t_s) const = 0;
};

/// Camera axes of a camera that looks along the body's x axis, image top along its z axis.
[[nodiscard]] Pose forward_camera();

/// @param X_BV  nominal place of the camera that shall see the tags; the body is moved so that this
/// camera looks well.
[[nodiscard]] Expected<std::unique_ptr<Trajectory>> make_trajectory(
    const TrajectoryConfig& config, const RoomConfig& room, const Pose& X_BV = forward_camera());

/// A source with the truth behind it. Deterministic: same configuration, same samples, whatever the
/// pace.
class SimulatedSource : public SensorSource {
 public:
  /// The true state at an instant of the source's own time line, past or future. Thread-safe.
  [[nodiscard]] virtual TruthSample truth(Instant at) const = 0;
  [[nodiscard]] virtual Instant start() const = 0;
  /// Where the cameras truly sit, whatever is believed about them.
  [[nodiscard]] virtual const std::vector<CameraMount>& cameras() const = 0;
};

/// @param clock  paced: samples come when they are due on this clock, and t = 0 is `start`;
///               nullptr: as fast as they are asked for, stamped from `start`.
/// @param motion what the robot does instead of the configured trajectory; nullptr: that
[[nodiscard]] Expected<std::unique_ptr<SimulatedSource>> make_simulated_source(
    const RoomConfig& room, const SimulatedBodyConfig& body, Instant start, const Clock* clock,
    std::unique_ptr<Trajectory> motion = nullptr);

}  // namespace fiducap::simulation
