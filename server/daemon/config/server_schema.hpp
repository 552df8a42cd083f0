#pragma once

#include "daemon/config/config_schema.hpp"
#include "daemon/config/simulation_schema.hpp"

/// The rest of what a configuration file may say: bodies, streaming and the whole.
namespace fiducap {

template <class V>
void describe(V& v, dds::RosSourceConfig& c) {
  v.value("images", c.images);
  v.value("imu", c.imu);
  v.value("reliable", c.reliable);
  v.value("synchronized", c.synchronized);
  v.value("camera_info_wait_s", c.camera_info_wait_s);
}

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
    case SourceType::kRos:
      describe(v, c.ros);
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
void describe(V& v, vrpn::ExtraSensor& c) {
  v.value("body", c.body);
  v.value("X_PS", c.X_PS);
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
  v.value("aliases", c.aliases);
  v.value("minor_version", c.minor_version);
  v.value("workspace_box_m", c.workspace_box_m);
  v.list("sensors", c.sensors);
}

template <class V>
void describe(V& v, native::NativeConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.value("lease_s", c.lease_s);
  v.value("discovery", c.discovery);
  v.value("control", c.control);
  v.value("multicast_group", c.multicast_group);
  v.value("multicast_port", c.multicast_port);
  v.value("multicast_ttl", c.multicast_ttl);
  v.value("multicast_interface", c.multicast_interface);
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
  v.value("aliases", c.aliases);
  v.value("targets", c.targets);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.value("client_timeout_s", c.client_timeout_s);
  v.word("remote_control", c.remote_control, words::kRemoteControl);
}

template <class V>
void describe(V& v, vicon::ViconConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.word("when_invalid", c.when_invalid, words::kWhenInvalid);
  v.value("aliases", c.aliases);
}

template <class V>
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
  v.value("aliases", c.aliases);
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
void describe(V& v, dds::DdsConfig& c) {
  v.value("enabled", c.enabled);
  v.value("prefix", c.prefix);
  v.value("world_frame", c.world_frame);
  v.value("aliases", c.aliases);
  v.value("pose", c.pose);
  v.value("twist", c.twist);
  v.value("odometry", c.odometry);
  v.value("tf", c.tf);
  v.value("poses", c.poses);
  v.value("poses_deadline_hz", c.poses_deadline_hz);
  v.value("rigid_bodies", c.rigid_bodies);
  v.value("diagnostics", c.diagnostics);
  v.value("native", c.native);
  v.word("px4", c.px4, words::kPx4Profile);
  v.value("px4_rate_hz", c.px4_rate_hz);
  v.value("reliable", c.reliable);
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
void describe(V& v, mavlink::VehicleConfig& c) {
  v.value("body", c.body);
  v.value("address", c.address);
  v.value("port", c.port);
  v.word("message", c.message, words::kPoseMessage);
  v.word("world", c.world, words::kAutopilotWorld);
  v.value("rate_hz", c.rate_hz);
  v.value("system_id", c.system_id);
  v.value("component_id", c.component_id);
}

template <class V>
void describe(V& v, mavlink::MavlinkConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.list("vehicles", c.vehicles);
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
  v.section("dds", c.dds);
  v.section("mavlink", c.mavlink);
}

template <class V>
void describe(V& v, OperatorConfig& c) {
  v.value("token", c.token);
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
