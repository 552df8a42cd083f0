#pragma once

#include "daemon/config/config_file.hpp"
#include "daemon/config/config_words.hpp"
#include "daemon/config/mocap_schema.hpp"

/// What a configuration file may say about the protocols; see config_schema.hpp.
namespace fiducap {

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

}  // namespace fiducap
