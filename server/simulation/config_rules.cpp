#include <algorithm>
#include <cmath>
#include <set>

#include "base/text.hpp"
#include "detection/tag_family.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

namespace {

constexpr double kUnitNorm = 1e-3;  // tolerance of the norm of a written quaternion

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

void require_pose(Checker& checker, const std::string& field, const Pose& X) {
  checker.require(
      X.p.allFinite() && X.q.coeffs().allFinite() && std::abs(X.q.norm() - 1) < kUnitNorm, field,
      X.q.norm(), "must be finite with a unit quaternion (shown: its norm)");
}

void append(std::vector<ConfigError>& all, const std::vector<ConfigError>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

std::vector<ConfigError> check(const ImuErrors& imu, const std::string& prefix) {
  return Checker{prefix}
      .not_negative("noise.gyro_noise_rad_s_rtHz", imu.noise.gyro_noise_rad_s_rtHz)
      .not_negative("noise.gyro_walk_rad_s2_rtHz", imu.noise.gyro_walk_rad_s2_rtHz)
      .not_negative("noise.accel_noise_m_s2_rtHz", imu.noise.accel_noise_m_s2_rtHz)
      .not_negative("noise.accel_walk_m_s3_rtHz", imu.noise.accel_walk_m_s3_rtHz)
      .within("noise.rate_hz", imu.noise.rate_hz, 1, 10000)
      .require(imu.gyro_bias.allFinite(), "gyro_bias", imu.gyro_bias.transpose(), "must be finite")
      .require(imu.accel_bias.allFinite(), "accel_bias", imu.accel_bias.transpose(),
               "must be finite")
      .within("scale_error", imu.scale_error, 0, 0.2)
      .within("misalignment_rad", imu.misalignment_rad, 0, 0.2)
      .positive("gyro_range_rad_s", imu.gyro_range_rad_s)
      .positive("accel_range_m_s2", imu.accel_range_m_s2)
      .errors;
}

std::vector<ConfigError> check(const CameraSimulation& camera, const std::string& prefix) {
  return Checker{prefix}
      .not_negative("corner_noise_px", camera.corner_noise_px)
      .within("exposure_s", camera.exposure_s, 0, 1)
      .within("exposure_lag_s", camera.exposure_lag_s, 0, 10)
      .within("pixel_noise", camera.pixel_noise, 0, 64)
      .within("vignetting", camera.vignetting, 0, 1)
      .not_negative("min_side_px", camera.min_side_px)
      .within("max_tilt_rad", camera.max_tilt_rad, 0, 1.5707)
      .within("miss_probability", camera.miss_probability, 0, 1)
      .within("latency_s", camera.latency_s, 0, 10)
      .errors;
}

std::vector<ConfigError> check(const FaultConfig& faults, const std::string& prefix) {
  return Checker{prefix}
      .within("drop_image", faults.drop_image, 0, 1)
      .within("drop_imu", faults.drop_imu, 0, 1)
      .within("delay_image_s", faults.delay_image_s, 0, 60)
      .within("jitter_s", faults.jitter_s, 0, 10)
      .within("occlude", faults.occlude, 0, 1)
      .within("occlude_corner", faults.occlude_corner, 0, 1)
      .within("wrong_id", faults.wrong_id, 0, 1)
      .not_negative("blackout_every_s", faults.blackout_every_s)
      .not_negative("blackout_s", faults.blackout_s)
      .require(faults.blackout_s == 0 || faults.blackout_s < faults.blackout_every_s, "blackout_s",
               faults.blackout_s, "must be shorter than blackout_every_s")
      .not_negative("moved_at_s", faults.moved_at_s)
      .require(faults.moved_by_m.allFinite(), "moved_by_m", faults.moved_by_m.transpose(),
               "must be finite")
      .within("image_stamp_error_s", faults.image_stamp_error_s, -1, 1)
      .within("imu_stamp_jitter_s", faults.imu_stamp_jitter_s, 0, 1)
      .not_negative("saturation_at_s", faults.saturation_at_s)
      .not_negative("saturation_s", faults.saturation_s)
      .positive("saturated_gyro_rad_s", faults.saturated_gyro_rad_s)
      .positive("saturated_accel_m_s2", faults.saturated_accel_m_s2)
      .errors;
}

std::vector<ConfigError> check(const TrajectoryConfig& trajectory, const std::string& prefix) {
  static const std::vector<std::string> kKinds{"survey", "hover",   "table", "sparse",
                                               "loop",   "ceiling", "file"};
  return Checker{prefix}
      .require(contains(kKinds, trajectory.kind), "kind", trajectory.kind,
               must_be_one_of(kKinds, trajectory.kind))
      .require(trajectory.kind != "file" || !trajectory.file.empty(), "file", trajectory.file,
               "must name a file when kind is file")
      .not_negative("duration_s", trajectory.duration_s)
      .within("speed", trajectory.speed, 0.01, 100)
      .within("from", trajectory.from, 0, 1)
      .within("share", trajectory.share, 0.05, 1)
      .errors;
}

std::vector<ConfigError> check(const CameraMount& mount, const std::string& prefix) {
  Checker checker{prefix};
  for (ConfigError error : mount.model.check()) {
    error.path = prefix + "model." + error.path;
    checker.errors.push_back(std::move(error));
  }
  checker.within("rate_hz", mount.rate_hz, 0.1, 1000);
  require_pose(checker, "X_BV", mount.X_BV);
  return checker.errors;
}

}  // namespace

std::vector<ConfigError> check(const RoomConfig& room, const std::string& prefix) {
  static const std::vector<std::string> kTextures{"clutter", "sharp", "plain"};
  Checker checker{prefix};
  checker
      .require(contains(room_presets(), room.preset), "preset", room.preset,
               must_be_one_of(room_presets(), room.preset))
      .require(is_tag_family(room.family), "family", room.family, tag_family_rule(room.family))
      .positive("tag_size_m", room.tag_size_m)
      .within("gravity_m_s2", room.gravity_m_s2, 0, 30)
      .within("daylight.factor", room.daylight.factor, 1, 100)
      .require(room.daylight.factor == 1 ||
                   (room.daylight.low.array() < room.daylight.high.array()).all(),
               "daylight.high", room.daylight.high.transpose(),
               "must be above daylight.low on every axis")
      .require(contains(kTextures, room.texture), "texture", room.texture,
               must_be_one_of(kTextures, room.texture))
      .require(room.preset != "custom" || !room.tags.empty(), "tags", room.tags.size(),
               "must name at least one tag when preset is custom");
  std::set<int> ids;
  for (std::size_t i = 0; i < room.tags.size(); ++i) {
    const RecordedTag& tag = room.tags[i];
    const std::string field = "tags[" + std::to_string(i) + "].";
    checker.require(ids.insert(tag.tag_id).second, field + "tag_id", tag.tag_id, "must be unique")
        .not_negative(field + "edge_m", tag.edge_m);
    require_pose(checker, field + "X_WT", tag.X_WT);
  }
  const auto family = TagFamily::named(room.family);
  if (!family) return checker.errors;
  for (const RecordedTag& tag : tags_of(room)) {
    const std::string fault = family->fault_of(tag.tag_id);
    checker.require(fault.empty(), "tags", tag.tag_id, fault);
  }
  return checker.errors;
}

std::vector<ConfigError> check(const SimulatedBodyConfig& body, const std::string& prefix) {
  Checker checker{prefix};
  checker.require(body.has_imu || !body.cameras.empty(), "cameras", body.cameras.size(),
                  "must have at least one when has_imu is false");
  for (std::size_t i = 0; i < body.cameras.size(); ++i) {
    append(checker.errors, check(body.cameras[i], prefix + "cameras[" + std::to_string(i) + "]."));
    const double exposure_share = body.camera.exposure_s * body.cameras[i].rate_hz;
    checker.require(exposure_share <= 1, "camera.exposure_s", body.camera.exposure_s,
                    "must fit between two images");
    const double readout_s = body.cameras[i].readout_s;
    checker.require(!body.camera.images || readout_s == 0,
                    "cameras[" + std::to_string(i) + "].readout_s", readout_s,
                    "must be 0 with images, which have a global shutter; corners "
                    "(camera.images: false) support rolling ones");
  }
  append(checker.errors, check(body.imu, prefix + "imu."));
  append(checker.errors, check(body.camera, prefix + "camera."));
  append(checker.errors, check(body.trajectory, prefix + "trajectory."));
  append(checker.errors, check(body.faults, prefix + "faults."));
  return checker.errors;
}

std::vector<ConfigError> check_source(const SimulatedBodyConfig& robot,
                                      const SourceSurroundings& around,
                                      const std::string& body_prefix) {
  Checker rules{body_prefix};
  rules
      .require(!around.cameras.empty(), "cameras", "[]",
               "a simulated body needs at least one camera")
      .require(!around.has_imu_source, "imu_source", "{…}",
               "is not allowed: a simulated body has its own IMU");
  // Cameras of a calibration file are checked when it has been read.
  if (robot.cameras.empty() && around.calibrated_by_files) return rules.errors;
  SimulatedBodyConfig as_simulated = robot;
  if (robot.cameras.empty()) as_simulated.cameras = around.cameras;
  append(rules.errors, check(as_simulated, body_prefix + "source."));
  return rules.errors;
}

}  // namespace fiducap::simulation
