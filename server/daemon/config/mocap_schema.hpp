#pragma once

#include "daemon/config/config_file.hpp"
#include "daemon/config/config_words.hpp"

/// What a configuration file may say about the protocols of motion capture systems; see
/// config_schema.hpp.
namespace fiducap {

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

}  // namespace fiducap
