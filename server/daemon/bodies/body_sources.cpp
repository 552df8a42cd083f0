// Four functions per source of a whole body, two per source of one sensor.
#include "daemon/bodies/body_sources.hpp"

#include <utility>

#include "capture/camera_device.hpp"
#include "capture/imu/imu_source.hpp"
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
  if (const auto gravity = setup.recording->gravity_m_s2) setup.sensors.tell_gravity(*gravity);
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

// --- sensors with sources of their own ---------------------------------------------------------

Expected<void> read_own(const SensorsConfig&, const simulation::RoomConfig&, BodySetup&) {
  return {};
}

std::optional<ImuNoise> imu_of(const SensorsConfig&, const BodySetup&) { return std::nullopt; }

Opened open(const SensorsConfig&, BodySetup&, const OpeningContext&) {
  return fail(ErrorCode::kInvalid, "every sensor of this body has a source of its own");
}

bool may_come_back(const SensorsConfig&) { return true; }

/// Gives the images of a source of one camera the number that the camera has on its body.
class NumberedCamera final : public SensorSource {
 public:
  NumberedCamera(std::unique_ptr<SensorSource> source, std::size_t camera)
      : source_(std::move(source)), camera_(static_cast<int>(camera)) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    auto sample = source_->next(std::move(stop));
    if (!sample || !sample->has_value()) return sample;
    if (auto* image = std::get_if<CameraFrame>(&**sample)) image->camera = camera_;
    return sample;
  }

 private:
  std::unique_ptr<SensorSource> source_;
  int camera_;
};

Opened open_one(CameraDeviceConfig device, CameraMount& mount, const OpeningContext& context) {
  device.paced = true;
  device.time_shift = mount.time_shift;
  return open_camera_device(device, mount.model, context.clock);
}

Opened open_one(const dds::RosCameraConfig& topic, CameraMount& mount,
                const OpeningContext& context) {
  auto participant = context.join_dds();
  if (!participant) return tl::unexpected(participant.error());
  const dds::RosSourceConfig ros = topic.as_source();
  std::vector<CameraMount> cameras{mount};
  if (auto asked = dds::ask_for_lenses(**participant, ros, cameras, context.clock); !asked)
    return tl::unexpected(asked.error());
  mount.model = cameras.front().model;
  return dds::open_ros_source(std::move(*participant), ros, cameras, context.clock);
}

Opened open_camera(const CameraSourceConfig& source, std::size_t k, BodySetup& setup,
                   const OpeningContext& context) {
  CameraMount& mount = setup.sensors.cameras[k];
  auto opened = source.type == CameraSourceType::kRos ? open_one(source.ros, mount, context)
                                                      : open_one(source.camera, mount, context);
  if (!opened) return opened;
  return std::make_unique<NumberedCamera>(std::move(*opened), k);
}

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
  if (body.imu_source) return ImuNoise{};
  return visit_source(body.source, [&](const auto& source) { return imu_of(source, setup); });
}

std::vector<SensorPart> parts_of(const BodyConfig& body) {
  std::vector<SensorPart> parts;
  if (body.source.type != SourceType::kSensors) parts.push_back({});
  for (std::size_t k = 0; k < body.cameras.size(); ++k) {
    if (body.cameras[k].source) parts.push_back({k});
  }
  if (body.imu_source && body.use_imu) parts.push_back({.is_imu = true});
  return parts;
}

std::string name_of(const SensorPart& part) {
  if (part.is_imu) return "IMU";
  return part.camera ? "camera " + std::to_string(*part.camera) : "source";
}

Opened open_source(const BodyConfig& body, const SensorPart& part, BodySetup& setup,
                   OpeningContext context) {
  if (part.is_imu) return open_imu_source(*body.imu_source, {context.clock, context.join_dds});
  if (part.camera)
    return open_camera(*body.cameras[*part.camera].source, *part.camera, setup, context);
  return visit_source(body.source,
                      [&](const auto& source) { return open(source, setup, std::move(context)); });
}

bool may_come_back(const BodyConfig& body, const SensorPart& part) {
  if (part.is_imu) return true;
  if (part.camera) {
    const CameraSourceConfig& own = *body.cameras[*part.camera].source;
    return own.type == CameraSourceType::kRos || may_come_back(own.camera);
  }
  return visit_source(body.source, [](const auto& source) { return may_come_back(source); });
}

bool tells_lens(const BodyConfig& body, std::size_t k) {
  const auto& own = body.cameras[k].source;
  return own ? own->tells_lens() : tells_lenses(body.source);
}

std::unique_ptr<SensorSource> failed_source(Error error) {
  return std::make_unique<FailedSource>(std::move(error));
}

}  // namespace fiducap
