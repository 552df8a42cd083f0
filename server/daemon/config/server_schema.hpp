#pragma once

#include "daemon/config/config_schema.hpp"
#include "simulation/simulation_schema.hpp"

/// The rest of what a configuration file may say: bodies and the whole.
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
