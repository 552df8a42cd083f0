#pragma once

#include "daemon/config/config_schema.hpp"
#include "simulation/simulation.hpp"

/// Keys of simulated rooms and robots.
namespace fiducap::simulation {

template <class V>
void describe(V& v, DaylightConfig& c) {
  v.value("factor", c.factor);
  v.value("low", c.low);
  v.value("high", c.high);
}

template <class V>
void describe(V& v, RingConfig& c) {
  v.value("length_m", c.length_m);
  v.value("tags", c.tags);
}

template <class V>
void describe(V& v, RoomConfig& c) {
  v.value("preset", c.preset);
  v.value("family", c.family);
  c.family = listed_tag_family(c.family);
  v.value("tag_size_m", c.tag_size_m);
  v.list("tags", c.tags);
  v.value("gravity_m_s2", c.gravity_m_s2);
  v.section("ring", c.ring);
  v.section("daylight", c.daylight);
  v.value("texture", c.texture);
}

template <class V>
void describe(V& v, TrajectoryConfig& c) {
  v.value("kind", c.kind);
  v.path("file", c.file);
  v.value("duration_s", c.duration_s);
  v.value("speed", c.speed);
  v.value("from", c.from);
  v.value("share", c.share);
  v.value("seed", c.seed);
}

template <class V>
void describe(V& v, ImuErrors& c) {
  v.section("noise", c.noise);
  v.value("gyro_bias", c.gyro_bias);
  v.value("accel_bias", c.accel_bias);
  v.value("scale_error", c.scale_error);
  v.value("misalignment_rad", c.misalignment_rad);
  v.value("gyro_range_rad_s", c.gyro_range_rad_s);
  v.value("accel_range_m_s2", c.accel_range_m_s2);
}

template <class V>
void describe(V& v, CameraSimulation& c) {
  v.value("images", c.images);
  v.value("corner_noise_px", c.corner_noise_px);
  v.value("exposure_s", c.exposure_s);
  v.value("exposure_lag_s", c.exposure_lag_s);
  v.value("pixel_noise", c.pixel_noise);
  v.value("vignetting", c.vignetting);
  v.value("min_side_px", c.min_side_px);
  v.value("max_tilt_rad", c.max_tilt_rad);
  v.value("miss_probability", c.miss_probability);
  v.value("latency_s", c.latency_s);
}

template <class V>
void describe(V& v, FaultConfig& c) {
  v.value("drop_image", c.drop_image);
  v.value("drop_imu", c.drop_imu);
  v.value("delay_image_s", c.delay_image_s);
  v.value("jitter_s", c.jitter_s);
  v.value("occlude", c.occlude);
  v.value("occlude_corner", c.occlude_corner);
  v.value("wrong_id", c.wrong_id);
  v.value("blackout_every_s", c.blackout_every_s);
  v.value("blackout_s", c.blackout_s);
  v.value("moved_tag", c.moved_tag);
  v.value("moved_at_s", c.moved_at_s);
  v.value("moved_by_m", c.moved_by_m);
  v.value("image_stamp_error_s", c.image_stamp_error_s);
  v.value("imu_stamp_jitter_s", c.imu_stamp_jitter_s);
  v.value("saturation_at_s", c.saturation_at_s);
  v.value("saturation_s", c.saturation_s);
  v.value("saturated_gyro_rad_s", c.saturated_gyro_rad_s);
  v.value("saturated_accel_m_s2", c.saturated_accel_m_s2);
}

/// Without `has_imu`, which follows from the body's `use_imu`.
template <class V>
void describe(V& v, SimulatedBodyConfig& c) {
  v.list("cameras", c.cameras);
  v.section("imu", c.imu);
  v.section("camera", c.camera);
  v.section("trajectory", c.trajectory);
  v.section("faults", c.faults);
  v.value("seed", c.seed);
}

}  // namespace fiducap::simulation

/// Content of a configuration file: bodies and the whole.
namespace fiducap {

template <class V>
void describe(V& v, SiteConfig& c) {
  v.value("gravity_m_s2", c.gravity_m_s2);
  v.value("latitude_deg", c.latitude_deg);
  v.value("height_m", c.height_m);
}

template <class V>
void describe(V& v, BodyConfig& c) {
  v.value("name", c.name);
  v.value("id", c.id);
  v.value("filter", c.filter);
  v.section("source", c.source);
  v.list("cameras", c.cameras);
  v.optional_section("imu_source", c.imu_source);
  v.value("use_imu", c.use_imu);
  v.path("kalibr_imu", c.kalibr_imu);
  v.path("imu_correction", c.imu_correction);
  v.optional_section("imu", c.imu);
  v.value("pivot", c.pivot);
  v.section("limits", c.limits);
}

template <class V>
void describe(V& v, dds::NetworkConfig& c) {
  v.value("domain", c.domain);
  v.value("interface", c.interface);
  v.value("peers", c.peers);
  v.value("max_participants", c.max_participants);
  v.value("announce_s", c.announce_s);
}

template <class V>
void describe(V& v, StreamingConfig& c) {
  v.value("rate_hz", c.rate_hz);
  v.value("optional", c.optional);
  for_each_protocol([&v](std::string_view name, auto& config) { v.section(name.data(), config); },
                    c);
}

template <class V>
void describe(V& v, OperatorConfig& c) {
  v.secret("token", c.token);
  v.path("token_file", c.token_file);
  v.secret("read_token", c.read_token);
  v.path("read_token_file", c.read_token_file);
  v.path("audit_file", c.audit_file);
}

template <class V>
void describe(V& v, RecorderConfig& c) {
  v.path("folder", c.folder);
  v.value("images", c.images);
  v.value("at_start", c.at_start);
}

template <class V>
void describe(V& v, ServerConfig& c) {
  v.word("log_level", c.log_level, words::kLogLevel);
  v.section("site", c.site);
  v.section("tags", c.tags);
  v.section("detector", c.detector);
  v.section("estimator", c.estimator);
  v.section("map", c.map);
  v.section("simulation", c.simulation);
  v.list("bodies", c.bodies);
  v.section("streaming", c.streaming);
  v.section("dds", c.dds);
  v.section("operator", c.operators);
  v.section("recorder", c.recorder);
}

}  // namespace fiducap
