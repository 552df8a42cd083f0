#include "daemon/served_protocols.hpp"

#include "streaming/conventions/protocol_conventions.hpp"

namespace fiducap {

namespace {

/// Of its data port it only needs to send, not to listen.
std::vector<PortUse> natnet_ports(const natnet::NatNetConfig& config) {
  std::vector<PortUse> ports;
  if (config.unicast) ports.push_back({config.port, true});
  if (config.multicast) ports.push_back({config.multicast_command_port, true});
  return ports;
}

}  // namespace

std::vector<ServedProtocol> served_protocols(const StreamingConfig& streaming) {
  const auto& vrpn = streaming.vrpn;
  const auto& native = streaming.native;
  const auto& natnet = streaming.natnet;
  const auto& vicon = streaming.vicon;
  const auto& qualisys = streaming.qualisys;
  const auto& mavlink = streaming.mavlink;
  const auto qualisys_port = [&](int i) {
    return static_cast<std::uint16_t>(qualisys.base_port + i);
  };
  return {
      {"vrpn",
       vrpn.enabled,
       vrpn.address,
       {{vrpn.port, false}, {vrpn.port, true}},
       vrpn.axes(),
       conventions_of("vrpn").when_invalid},
      {"natnet", natnet.enabled, natnet.address, natnet_ports(natnet), natnet.axes(),
       natnet.when_invalid},
      {"vicon",
       vicon.enabled,
       vicon.address,
       {{vicon.port, false}},
       conventions_of("vicon").axes,
       vicon.when_invalid},
      {"qualisys",
       qualisys.enabled,
       qualisys.address,
       {{qualisys_port(1), false}, {qualisys_port(2), false}, {qualisys.discovery_port, true}},
       qualisys.axes(),
       qualisys.when_invalid == WhenInvalid::kStop ? WhenInvalid::kFlag
                                                   : qualisys.when_invalid},  // its list is fixed
      {"native",
       native.enabled,
       native.address,
       {{native.port, true}},
       conventions_of("native").axes,
       conventions_of("native").when_invalid},
      {"mavlink",
       mavlink.enabled,
       mavlink.address,
       {{mavlink.port, true}},
       conventions_of("mavlink").axes,
       conventions_of("mavlink").when_invalid},
  };
}

}  // namespace fiducap
