#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sensor_source.hpp"
#include "daemon/config/config_file.hpp"
#include "middleware/participant.hpp"

namespace fiducap {

/// A body's sensors after every file that its configuration names has been read.
struct BodySetup {
  BodySensors sensors;
  std::vector<CameraMount>
      configured_cameras;  ///< `sensors.cameras` before a map store refined it.
  std::optional<RecordingInfo> recording;
};

/// What sources need beside their configuration to be opened. Each takes what it wants.
struct OpeningContext {
  const simulation::RoomConfig& room;
  const Clock& clock;
  Instant simulation_start{};  ///< The same for all bodies, so that they share one time.
  std::unique_ptr<simulation::Trajectory> motion{};  ///< Of a robot that a program moves.
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds{};
};

/// One of the sources of a body: of all its sensors, of one camera, or of the IMU.
struct SensorPart {
  std::optional<std::size_t> camera{};
  bool is_imu{false};
};

[[nodiscard]] inline bool gives_images(const SensorPart& part) { return !part.is_imu; }

/// As the configuration names them; never empty.
[[nodiscard]] std::vector<SensorPart> parts_of(const BodyConfig& body);
/// In words: `source`, `camera 1`, `IMU`.
[[nodiscard]] std::string name_of(const SensorPart& part);

/// What the source says of itself before it is opened, into `setup`: cameras, gravity.
[[nodiscard]] Expected<void> read_own_setup(const BodyConfig& body,
                                            const simulation::RoomConfig& room, BodySetup& setup);

/// The noise of the source's own IMU, unless the configuration has another; nullopt: it has none.
[[nodiscard]] std::optional<ImuNoise> own_imu(const BodyConfig& body, const BodySetup& setup);

/// Opens the samples of one part, in real time. A source that tells lenses puts those that the
/// configuration does not describe into `setup`, which may take a while.
[[nodiscard]] Expected<std::unique_ptr<SensorSource>> open_source(const BodyConfig& body,
                                                                  const SensorPart& part,
                                                                  BodySetup& setup,
                                                                  OpeningContext context);

/// Whether it is a device, which may be unplugged or not be up yet, and come back.
[[nodiscard]] bool may_come_back(const BodyConfig& body, const SensorPart& part);
/// Whether the lens of camera `k` comes by its source, once that is open.
[[nodiscard]] bool tells_lens(const BodyConfig& body, std::size_t k);

/// Stands in for a source that could not be opened: gives nothing but this error.
[[nodiscard]] std::unique_ptr<SensorSource> failed_source(Error error);

}  // namespace fiducap
