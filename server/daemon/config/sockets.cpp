#include "daemon/config/sockets.hpp"

namespace fiducap {

bool OwnSocket::collides_with(const OwnSocket& other) const {
  return port.number != 0 && port.number == other.port.number && port.udp == other.port.udp &&
         (address == other.address || is_any(address) || is_any(other.address));
}

bool is_any(std::string_view address) { return address == "0.0.0.0" || address == "::"; }

std::string text_of(const PortUse& port) {
  return std::to_string(port.number) + (port.udp ? " udp" : " tcp");
}

std::vector<ServedProtocol> served_protocols(const StreamingConfig& streaming) {
  std::vector<ServedProtocol> all;
  for_each_protocol(
      [&all](std::string_view, const auto& config) {
        if constexpr (requires { config.served(); }) all.push_back(config.served());
      },
      streaming);
  return all;
}

std::vector<OwnSocket> sockets_of(const ServedProtocol& protocol) {
  std::vector<OwnSocket> all;
  for (const PortUse& port : protocol.ports)
    all.push_back({"streaming." + std::string(protocol.name),
                   port.address.empty() ? protocol.address : port.address, port});
  return all;
}

std::vector<OwnSocket> sockets_of(const ServerConfig& config) {
  std::vector<OwnSocket> all;
  for (const ServedProtocol& protocol : served_protocols(config.streaming)) {
    if (!protocol.enabled) continue;
    for (OwnSocket& one : sockets_of(protocol)) all.push_back(std::move(one));
  }
  for (std::size_t i = 0; i < config.bodies.size(); ++i) {
    const BodyConfig& body = config.bodies[i];
    const auto* link = body.imu_source && body.use_imu ? body.imu_source->link() : nullptr;
    if (link != nullptr && link->device.empty())
      all.push_back(
          {"bodies." + std::to_string(i) + ".imu_source", link->address, {link->port, true}});
  }
  return all;
}

}  // namespace fiducap
