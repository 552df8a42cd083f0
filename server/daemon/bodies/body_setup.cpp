#include "daemon/bodies/body_setup.hpp"

#include <fstream>
#include <sstream>
#include <utility>

#include "base/log.hpp"
#include "capture/lens/camera_calibration_file.hpp"
#include "capture/lens/kalibr_file.hpp"
#include "detection/tag_family_list.hpp"
#include "simulation/simulation.hpp"

namespace fiducap {

namespace {

/// Kalibr's camchain starts each camera with its name.
bool is_camchain(const std::string& file) {
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    if (line.rfind("cam0:", 0) == 0) return true;
  }
  return false;
}

/// Takes over what the file says; the rest of the mount stays as configured.
Expected<CameraMount> read_mount(const CameraConfig& camera, std::size_t place) {
  CameraMount mount = camera.mount;
  if (camera.calibration.empty()) return mount;
  if (!is_camchain(camera.calibration)) return read_camera_calibration(camera.calibration, mount);
  auto chain = read_kalibr_camchain(camera.calibration);
  if (!chain) return tl::unexpected(chain.error());
  const std::size_t which =
      chain->size() == 1 ? 0 : place;  // camera K of the body is camK of the file
  if (which >= chain->size()) {
    return fail(ErrorCode::kNotFound,
                "has " + std::to_string(chain->size()) + " cameras, but the body's camera " +
                    std::to_string(place) + " wants cam" + std::to_string(place),
                camera.calibration);
  }
  const CameraMount& read = (*chain)[which];
  mount.model = read.model;
  mount.X_BV = read.X_BV;
  mount.time_shift = read.time_shift;
  return mount;
}

Expected<std::optional<ImuNoise>> read_imu(const BodyConfig& body, const BodySetup& setup) {
  const std::optional<ImuNoise> own = own_imu(body, setup);
  if (!body.use_imu || !own) return std::nullopt;
  ImuNoise noise = body.imu ? *body.imu : *own;
  if (!body.kalibr_imu.empty()) {
    const auto read = read_kalibr_imu(body.kalibr_imu);
    if (!read) return tl::unexpected(read.error());
    noise = *read;
  }
  noise.correction = own->correction;  // what a recording was made with
  if (!body.imu_correction.empty()) {
    const auto read = read_imu_correction(body.imu_correction);
    if (!read) return tl::unexpected(read.error());
    noise.correction = *read;
  }
  return noise;
}

}  // namespace

Expected<BodySetup> read_body_setup(const BodyConfig& body, const simulation::RoomConfig& room,
                                    const SiteConfig& site) {
  BodySetup setup;
  if (auto own = read_own_setup(body, room, setup); !own) return tl::unexpected(own.error());
  if (!body.cameras.empty()) setup.sensors.cameras.clear();
  for (std::size_t k = 0; k < body.cameras.size(); ++k) {
    auto mount = read_mount(body.cameras[k], k);
    if (!mount) return tl::unexpected(mount.error());
    const bool is_told_later = tells_lens(body, k) && mount->model.width == 0;
    if (const auto errors = mount->model.check(); !errors.empty() && !is_told_later) {
      return fail(ErrorCode::kInvalid, errors.front().text(), body.cameras[k].calibration);
    }
    setup.sensors.cameras.push_back(std::move(*mount));
  }
  auto imu = read_imu(body, setup);
  if (!imu) return tl::unexpected(imu.error());
  setup.sensors.imu = *imu;
  setup.configured_cameras = setup.sensors.cameras;
  if (const auto gravity = site.told_gravity()) setup.sensors.tell_gravity(*gravity);
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
  pipeline.records_segments = config.map.builder.refine_period_s > 0;
  if (setup.recording) pipeline.priors = tag_priors(*setup.recording);
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
  if (sensors.is_gravity_told()) info.gravity_m_s2 = sensors.gravity_m_s2;
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

std::vector<KnownTag> tag_priors(const RecordingInfo& recording) {
  std::vector<KnownTag> priors;
  for (const auto& tag : recording.known_tags) {
    KnownTag prior{tag.tag_id, tag.edge_m, tag.X_WT};
    prior.covariance.diagonal().head<3>().setConstant(tag.position_sigma_m * tag.position_sigma_m);
    prior.covariance.diagonal().tail<3>().setConstant(tag.rotation_sigma_rad *
                                                      tag.rotation_sigma_rad);
    priors.push_back(prior);
  }
  return priors;
}

void warn_about_tags(const std::string& body, const RecordingInfo& recording,
                     const TagSetConfig& tags) {
  const bool same = listed_tag_family(recording.tag_family) == tags.family &&
                    recording.tag_size_m == tags.size_m && recording.tag_sizes_m == tags.sizes_m &&
                    recording.ignore_tags == tags.ignore;
  if (same) return;
  std::ostringstream text;
  text << body << ": the recording says: tags.family = " << recording.tag_family
       << ", tags.size_m = " << recording.tag_size_m << ", " << recording.tag_sizes_m.size()
       << " tags of other sizes, " << recording.ignore_tags.size()
       << " ids to ignore; the configuration says: " << tags.family << ", " << tags.size_m << ", "
       << tags.sizes_m.size() << ", " << tags.ignore.size() << ", and that is what holds";
  log::warning("daemon", text.str());
}

}  // namespace fiducap
