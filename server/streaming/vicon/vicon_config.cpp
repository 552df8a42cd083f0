#include "streaming/vicon/vicon_config.hpp"

#include "middleware/net/peer.hpp"

namespace fiducap::vicon {

std::vector<ConfigError> ViconConfig::check() const {
  return Checker{"streaming.vicon."}
      .require(net::parse_address(address).has_value(), "address", address,
               "must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all")
      .within("max_clients", max_clients, 1, 256)
      .within("max_clients_per_address", max_clients_per_address, 1, 256)
      .errors;
}

ServedProtocol ViconConfig::served() const {
  return {"vicon", enabled, address, {{port, false}}, conventions_of("vicon").axes, when_invalid};
}

}  // namespace fiducap::vicon
