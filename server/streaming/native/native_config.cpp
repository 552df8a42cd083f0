#include "streaming/native/native_config.hpp"

#include "middleware/net/peer.hpp"

namespace fiducap::native {

std::vector<ConfigError> NativeConfig::check() const {
  const auto group = net::parse_address(multicast_group);
  const bool is_group = group && *group >> 28 == 0xe;  // 224.0.0.0 to 239.255.255.255
  return Checker{"streaming.native."}
      .require(net::is_address(address), "address", address,
               "must be an IP address, e.g. 127.0.0.1 or 0.0.0.0")
      .within("max_clients", max_clients, 1, 1024)
      .within("max_clients_per_address", max_clients_per_address, 1, 1024)
      .within("lease_s", lease_s, 0.5, 60)
      .require(multicast_group.empty() || is_group, "multicast_group", multicast_group,
               "must be an IPv4 multicast address, e.g. 239.255.42.16, or empty")
      .require(multicast_group.empty() || multicast_port != 0, "multicast_port",
               std::to_string(multicast_port), "must not be 0")
      .within("multicast_ttl", multicast_ttl, 0, 255)
      .require(multicast_interface.empty() || net::parse_address(multicast_interface),
               "multicast_interface", multicast_interface,
               "must be an IPv4 address of this machine, or empty")
      .errors;
}

ServedProtocol NativeConfig::served() const {
  const ProtocolConventions& conventions = conventions_of("native");
  return {"native", enabled, address, {{port, true}}, conventions.axes, conventions.when_invalid};
}

}  // namespace fiducap::native
