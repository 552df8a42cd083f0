// Four functions per source; `visit_source` chooses among the sources.
#include "daemon/bodies/body_sources.hpp"

#include <utility>

#include "capture/camera_device.hpp"
#include "capture/ros/ros_source.hpp"
#include "simulation/simulation.hpp"

namespace fiducap {

namespace {

using Opened = Expected<std::unique_ptr<SensorSource>>;

// --- a simulated robot -------------------------------------------------------------------------

Expected<void> read_own(const simulation::SimulatedBodyConfig&, const simulation::RoomConfig& room,
                        BodySetup& setup) {
  setup.sensors.gravity_m_s2 = room.gravity_m_s2;
  return {};
}

std::optional<ImuNoise> imu_of(const simulation::SimulatedBodyConfig& config, const BodySetup&) {
  return config.imu.noise;
}

/// With true cameras, and an IMU only if it is read.
Opened open(simulation::SimulatedBodyConfig robot, BodySetup& setup, OpeningContext context) {
  if (robot.cameras.empty()) robot.cameras = setup.configured_cameras;
  robot.has_imu = setup.sensors.imu.has_value();
  auto made = simulation::make_simulated_source(context.room, robot, context.simulation_start,
                                                &context.clock, std::move(context.motion));
  if (!made) return tl::unexpected(made.error());
  return std::unique_ptr<SensorSource>(std::move(*made));
}

bool may_come_back(const simulation::SimulatedBodyConfig&) { return false; }

// --- a recording -------------------------------------------------------------------------------

Expected<void> read_own(const RecordingSourceConfig& config, const simulation::RoomConfig&,
                        BodySetup& setup) {
  auto info = read_recording_info(config.folder);
  if (!info) return tl::unexpected(info.error());
  setup.recording = std::move(*info);
  setup.sensors.cameras = setup.recording->cameras;
  return {};
}

std::optional<ImuNoise> imu_of(const RecordingSourceConfig&, const BodySetup& setup) {
  return setup.recording->imu;
}

Opened open(const RecordingSourceConfig& config, BodySetup& setup, const OpeningContext& context) {
  return open_recording(*setup.recording, {true, config.loop, config.speed}, context.clock);
}

bool may_come_back(const RecordingSourceConfig&) { return false; }

// --- one camera --------------------------------------------------------------------------------

Expected<void> read_own(const CameraDeviceConfig&, const simulation::RoomConfig&, BodySetup&) {
  return {};
}

std::optional<ImuNoise> imu_of(const CameraDeviceConfig&, const BodySetup&) { return std::nullopt; }

Opened open(CameraDeviceConfig device, BodySetup& setup, const OpeningContext& context) {
  const CameraMount& mount = setup.sensors.cameras.front();
  device.paced = true;
  device.time_shift = mount.time_shift;
  return open_camera_device(device, mount.model, context.clock);
}

bool may_come_back(const CameraDeviceConfig& device) { return !is_file(device); }

// --- ROS 2 topics ------------------------------------------------------------------------------

Expected<void> read_own(const dds::RosSourceConfig&, const simulation::RoomConfig&, BodySetup&) {
  return {};
}

std::optional<ImuNoise> imu_of(const dds::RosSourceConfig& config, const BodySetup&) {
  return config.imu.empty() ? std::nullopt : std::optional(ImuNoise{});
}

Opened open(dds::RosSourceConfig ros, BodySetup& setup, const OpeningContext& context) {
  auto participant = context.join_dds();
  if (!participant) return tl::unexpected(participant.error());
  if (!setup.sensors.imu) ros.imu.clear();
  auto& cameras = setup.sensors.cameras;
  if (auto asked = dds::ask_for_lenses(**participant, ros, cameras, context.clock); !asked)
    return tl::unexpected(asked.error());
  return dds::open_ros_source(std::move(*participant), ros, cameras, context.clock);
}

bool may_come_back(const dds::RosSourceConfig&) { return true; }

// -----------------------------------------------------------------------------------------------

/// What stands in for a source that could not be opened: the body is lost from the start, the
/// others are served.
class FailedSource final : public SensorSource {
 public:
  explicit FailedSource(Error error) : error_(std::move(error)) {}
  Expected<std::optional<SensorSample>> next(std::stop_token) override {
    return tl::unexpected(error_);
  }

 private:
  Error error_;
};

}  // namespace

Expected<void> read_own_setup(const BodyConfig& body, const simulation::RoomConfig& room,
                              BodySetup& setup) {
  return visit_source(body.source,
                      [&](const auto& source) { return read_own(source, room, setup); });
}

std::optional<ImuNoise> own_imu(const BodyConfig& body, const BodySetup& setup) {
  return visit_source(body.source, [&](const auto& source) { return imu_of(source, setup); });
}

Opened open_source(const BodyConfig& body, BodySetup& setup, OpeningContext context) {
  return visit_source(body.source,
                      [&](const auto& source) { return open(source, setup, std::move(context)); });
}

bool may_come_back(const BodyConfig& body) {
  return visit_source(body.source, [](const auto& source) { return may_come_back(source); });
}

std::unique_ptr<SensorSource> failed_source(Error error) {
  return std::make_unique<FailedSource>(std::move(error));
}

}  // namespace fiducap
