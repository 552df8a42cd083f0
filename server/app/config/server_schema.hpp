#pragma once

#include "app/config/config_schema.hpp"
#include "app/config/simulation_schema.hpp"

/// The rest of what a configuration file may say: bodies, streaming and the whole.
namespace fiducap {

/// `type` comes first: it decides which other keys there are.
template <class V>
void describe(V& v, SourceConfig& c) {
  v.word("type", c.type, words::kSourceType);
  switch (c.type) {
    case SourceType::kSimulator:
      describe(v, c.simulator);
      break;
    case SourceType::kRecording:
      describe(v, c.recording);
      break;
    case SourceType::kCamera:
      describe(v, c.camera);
      break;
  }
}

template <class V>
void describe(V& v, BodyConfig& c) {
  v.value("name", c.name);
  v.value("id", c.id);
  v.value("filter", c.filter);
  v.section("source", c.source);
  v.list("cameras", c.cameras);
  v.value("use_imu", c.use_imu);
  v.path("kalibr_imu", c.kalibr_imu);
  v.optional_section("imu", c.imu);
  v.value("pivot", c.pivot);
  v.section("limits", c.limits);
}

template <class V>
void describe(V& v, vrpn::VrpnConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("max_clients", c.max_clients);
  v.value("udp_reports", c.udp_reports);
  v.value("velocity", c.velocity);
  v.value("acceleration", c.acceleration);
  v.word("up", c.up, words::kUpAxis);
  v.word("scope", c.scope, words::kAxesScope);
  v.value("minor_version", c.minor_version);
  v.value("workspace_box_m", c.workspace_box_m);
}

template <class V>
void describe(V& v, native::NativeConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.value("lease_s", c.lease_s);
}

template <class V>
void describe(V& v, natnet::NatNetConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("data_port", c.data_port);
  v.value("unicast", c.unicast);
  v.value("multicast", c.multicast);
  v.value("multicast_command_port", c.multicast_command_port);
  v.value("multicast_group", c.multicast_group);
  v.value("multicast_interface", c.multicast_interface);
  v.value("multicast_ttl", c.multicast_ttl);
  v.value("bitstream", c.bitstream);
  v.word("up", c.up, words::kUpAxis);
  v.word("scope", c.scope, words::kAxesScope);
  v.word("when_invalid", c.when_invalid, words::kWhenInvalid);
  v.value("targets", c.targets);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.value("client_timeout_s", c.client_timeout_s);
  v.word("remote_control", c.remote_control, words::kRemoteControl);
void describe(V& v, vicon::ViconConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.word("when_invalid", c.when_invalid, words::kWhenInvalid);
void describe(V& v, qualisys::QualisysConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("base_port", c.base_port);
  v.value("discovery_port", c.discovery_port);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.word("up", c.up, words::kUpAxis);
  v.word("scope", c.scope, words::kAxesScope);
  v.word("when_invalid", c.when_invalid, words::kWhenInvalid);
  v.value("qtm_version", c.qtm_version);
}

template <class V>
void describe(V& v, web::WebConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("rate_hz", c.rate_hz);
  v.value("max_clients", c.max_clients);
  v.path("root", c.root);
}

template <class V>
void describe(V& v, StreamingConfig& c) {
  v.value("rate_hz", c.rate_hz);
  v.value("optional", c.optional);
  v.section("vrpn", c.vrpn);
  v.section("native", c.native);
  v.section("natnet", c.natnet);
  v.section("vicon", c.vicon);
  v.section("qualisys", c.qualisys);
  v.section("web", c.web);
}

template <class V>
void describe(V& v, OperatorConfig& c) {
  v.value("token", c.token);
}

template <class V>
void describe(V& v, RecorderConfig& c) {
  v.path("folder", c.folder);
  v.value("images", c.images);
}

template <class V>
void describe(V& v, ServerConfig& c) {
  v.word("log_level", c.log_level, words::kLogLevel);
  v.section("tags", c.tags);
  v.section("detector", c.detector);
  v.section("estimator", c.estimator);
  v.section("map", c.map);
  v.section("simulation", c.simulation);
  v.list("bodies", c.bodies);
  v.section("streaming", c.streaming);
  v.section("operator", c.operators);
  v.section("recorder", c.recorder);
}

}  // namespace fiducap
