#include "daemon/bodies/body_setup.hpp"

#include <sstream>
#include <utility>

#include "base/log.hpp"
#include "capture/camera_device.hpp"
#include "capture/imu/imu_source.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/ros/ros_source.hpp"
#include "detection/tag_family.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "simulation/simulation.hpp"

namespace fiducap {
namespace {

// Per kind of source, by overloads: `read_own` (cameras and gravity known before it is opened, into
// the setup), `imu_of` (noise of its own IMU, unless configured), `open`, `may_come_back`.

template <class Config>
Expected<void> read_own(const Config&, const simulation::RoomConfig&, BodySetup&) {
  return {};
}

template <class Config>
std::optional<ImuNoise> imu_of(const Config&, const BodySetup&) {
  return std::nullopt;
}

template <class Config>
bool may_come_back(const Config&) {
  return true;
}

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
OpenedSource open(simulation::SimulatedBodyConfig robot, BodySetup& setup, OpeningContext context) {
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
  if (const auto gravity = setup.recording->gravity_m_s2) setup.sensors.set_known_gravity(*gravity);
  return {};
}

std::optional<ImuNoise> imu_of(const RecordingSourceConfig&, const BodySetup& setup) {
  return setup.recording ? setup.recording->imu : std::nullopt;
}

OpenedSource open(const RecordingSourceConfig& config, BodySetup& setup,
                  const OpeningContext& context) {
  return open_recording(*setup.recording, {true, config.loop, config.speed}, context.clock);
}

bool may_come_back(const RecordingSourceConfig&) { return false; }

// --- cameras -----------------------------------------------------------------------------------

OpenedSource open_device(CameraDeviceConfig device, const CameraMount& mount,
                         const OpeningContext& context) {
  device.paced = true;
  device.time_shift = mount.time_shift;
  return open_camera_device(device, mount.model, context.clock);
}

OpenedSource open(const CameraDeviceConfig& device, BodySetup& setup,
                  const OpeningContext& context) {
  return open_device(device, setup.sensors.cameras.front(), context);
}

bool may_come_back(const CameraDeviceConfig& device) { return !is_file(device); }

// --- ROS 2 topics ------------------------------------------------------------------------------

std::optional<ImuNoise> imu_of(const dds::RosSourceConfig& config, const BodySetup&) {
  return config.imu.empty() ? std::nullopt : std::optional(ImuNoise{});
}

OpenedSource open_topics(const dds::RosSourceConfig& ros, std::vector<CameraMount>& cameras,
                         const OpeningContext& context) {
  auto participant = context.join_dds();
  if (!participant) return tl::unexpected(participant.error());
  if (auto asked = dds::wait_for_lenses(**participant, ros, cameras, context.clock); !asked)
    return tl::unexpected(asked.error());
  return dds::open_ros_source(std::move(*participant), ros, cameras, context.clock);
}

OpenedSource open(dds::RosSourceConfig ros, BodySetup& setup, const OpeningContext& context) {
  if (!setup.sensors.imu) ros.imu.clear();
  return open_topics(ros, setup.sensors.cameras, context);
}

// --- sensors with sources of their own ---------------------------------------------------------

OpenedSource open(const SensorsConfig&, BodySetup&, const OpeningContext&) {
  return fail(ErrorCode::kInvalid, "every sensor of this body has a source of its own");
}

/// Numbers the images of a single camera as on its body.
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

OpenedSource open_camera(const CameraSourceConfig& source, std::size_t k, BodySetup& setup,
                         const OpeningContext& context) {
  CameraMount& mount = setup.sensors.cameras[k];
  std::vector<CameraMount> cameras{mount};
  auto opened = source.type == CameraSourceType::kRos
                    ? open_topics(source.ros.source, cameras, context)
                    : open_device(source.camera, mount, context);
  mount.model = cameras.front().model;  // known even if the topic cannot be opened
  if (!opened) return opened;
  return std::make_unique<NumberedCamera>(std::move(*opened), k);
}

/// The body is lost from the start, the others are served.
class FailedSource final : public SensorSource {
 public:
  explicit FailedSource(Error error) : error_(std::move(error)) {}
  Expected<std::optional<SensorSample>> next(std::stop_token) override {
    return tl::unexpected(error_);
  }

 private:
  Error error_;
};

/// The value that was read; a fault and `configured` when there is none.
template <class Read, class T>
T value_or(Expected<Read> read, T configured, std::vector<Error>& faults) {
  if (read) return std::move(*read);
  faults.push_back(std::move(read.error()));
  return configured;
}

/// The mount as configured, with the content of its calibration file.
Expected<CameraMount> read_mount(const CameraConfig& camera, std::size_t place) {
  CameraMount mount = camera.mount;
  if (camera.calibration.empty()) return mount;
  auto read = read_calibration(camera.calibration, mount);
  if (!read) return tl::unexpected(read.error());
  // Camera K of the body is camK of a file of several.
  const std::size_t which = read->size() == 1 ? 0 : place;
  if (which < read->size()) return (*read)[which].mount;
  return fail(ErrorCode::kNotFound,
              "has " + std::to_string(read->size()) + " cameras, but the body's camera " +
                  std::to_string(place) + " needs cam" + std::to_string(place),
              camera.calibration);
}

std::optional<ImuNoise> read_imu(const BodyConfig& body, const BodySetup& setup,
                                 std::vector<Error>& faults) {
  const std::optional<ImuNoise> own =
      body.imu_source
          ? ImuNoise{}
          : visit_source(body.source, [&](const auto& source) { return imu_of(source, setup); });
  if (!body.use_imu || !own) return std::nullopt;
  ImuNoise noise = body.imu ? *body.imu : *own;
  if (!body.kalibr_imu.empty()) noise = value_or(read_imu_noise(body.kalibr_imu), noise, faults);
  noise.correction = own->correction;  // of a recording
  if (!body.imu_correction.empty())
    noise.correction = value_or(read_imu_correction(body.imu_correction), noise.correction, faults);
  return noise;
}

}  // namespace

std::vector<SensorPart> parts_of(const BodyConfig& body) {
  std::vector<SensorPart> parts;
  if (body.source.type != SourceType::kSensors) parts.push_back({});
  for (std::size_t k = 0; k < body.cameras.size(); ++k)
    if (body.cameras[k].source) parts.push_back({k});
  if (body.imu_source && body.use_imu) parts.push_back({.is_imu = true});
  return parts;
}

std::string name_of(const SensorPart& part) {
  if (part.is_imu) return "IMU";
  return part.camera ? "camera " + std::to_string(*part.camera) : "source";
}

OpenedSource open_source(const BodyConfig& body, const SensorPart& part, BodySetup& setup,
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

std::unique_ptr<SensorSource> failed_source(Error error) {
  return std::make_unique<FailedSource>(std::move(error));
}

BodySetup read_body_setup(const BodyConfig& body, const simulation::RoomConfig& room,
                          const SiteConfig& site, std::vector<Error>& faults) {
  BodySetup setup;
  const auto read =
      visit_source(body.source, [&](const auto& own) { return read_own(own, room, setup); });
  if (!read) faults.push_back(read.error());
  if (!body.cameras.empty()) setup.sensors.cameras.clear();
  for (std::size_t k = 0; k < body.cameras.size(); ++k) {
    const auto before = faults.size();
    CameraMount mount = value_or(read_mount(body.cameras[k], k), body.cameras[k].mount, faults);
    const bool is_known_later =
        provides_lens(body.source, body.cameras[k]) && mount.model.width == 0;
    const auto errors = mount.model.check();
    if (!errors.empty() && !is_known_later && faults.size() == before)
      faults.push_back({ErrorCode::kInvalid, errors.front().text(), body.cameras[k].calibration});
    setup.sensors.cameras.push_back(std::move(mount));
  }
  setup.sensors.imu = read_imu(body, setup, faults);
  if (auto fault = fault_of_filter(body.filter, setup.sensors))
    faults.push_back({ErrorCode::kInvalid, std::move(*fault), body.name});
  setup.configured_cameras = setup.sensors.cameras;
  if (const auto gravity = site.configured_gravity()) setup.sensors.set_known_gravity(*gravity);
  return setup;
}

Expected<BodySetup> read_body_setup(const BodyConfig& body, const simulation::RoomConfig& room,
                                    const SiteConfig& site) {
  std::vector<Error> faults;
  BodySetup setup = read_body_setup(body, room, site, faults);
  if (!faults.empty()) return tl::unexpected(std::move(faults.front()));
  return setup;
}

PipelineSetup pipeline_setup(const ServerConfig& config, const BodyConfig& body,
                             const BodySetup& setup) {
  PipelineSetup pipeline;
  pipeline.sensors = setup.sensors;
  pipeline.tags = config.tags;
  pipeline.detector = config.detector;
  pipeline.estimator = config.estimator;
  pipeline.gauge = {config.map.reference_tag, config.map.reference_pose, config.map.floor_tags};
  pipeline.filter = body.filter;
  pipeline.records_segments = true;
  if (setup.recording)
    for (const RecordedTag& tag : setup.recording->known_tags)
      pipeline.priors.push_back(known_tag(tag));
  pipeline.lose_after_s = body.limits.lose_after_s;
  return pipeline;
}

RecordingInfo recording_of(const BodySensors& sensors, const TagSetConfig& tags,
                           std::optional<int> reference_tag) {
  RecordingInfo info;
  info.cameras = sensors.cameras;
  for (CameraMount& camera : info.cameras)
    camera.time_shift = {};  // stamps are on the server's clock already
  info.imu = sensors.imu;
  if (sensors.is_gravity_known()) info.gravity_m_s2 = sensors.gravity_m_s2;
  info.tag_family = tags.family;
  info.tag_size_m = tags.size_m;
  info.tag_sizes_m = tags.sizes_m;
  info.ignore_tags = tags.ignore;
  info.max_hamming = tags.max_hamming;
  info.reference_tag = reference_tag;
  return info;
}

SimulatedTruth truth_of(const SensorSource& source, const ServerConfig& config) {
  const auto* simulated = dynamic_cast<const simulation::SimulatedSource*>(&source);
  if (simulated == nullptr) return {};
  SimulatedTruth truth;
  truth.at = [simulated](Instant at) { return simulated->truth(at); };
  truth.tags = simulation::tags_of(config.simulation);
  for (const CameraMount& camera : simulated->cameras()) truth.X_BV.push_back(camera.X_BV);
  return truth;
}

void warn_about_tags(const std::string& body, const RecordingInfo& recording,
                     const TagSetConfig& tags) {
  const bool same = listed_tag_family(recording.tag_family) == tags.family &&
                    recording.tag_size_m == tags.size_m && recording.tag_sizes_m == tags.sizes_m &&
                    recording.ignore_tags == tags.ignore;
  if (same) return;
  std::ostringstream text;
  text << body << ": the recording has tags.family = " << recording.tag_family
       << ", tags.size_m = " << recording.tag_size_m << ", " << recording.tag_sizes_m.size()
       << " tags of other sizes, " << recording.ignore_tags.size()
       << " ids to ignore; the configuration, which is used, has " << tags.family << ", "
       << tags.size_m << ", " << tags.sizes_m.size() << ", " << tags.ignore.size();
  log::warning("daemon", text.str());
}

}  // namespace fiducap
