#include "streaming/mavlink/mavlink_config.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "middleware/net/peer.hpp"

namespace fiducap::mavlink {

std::vector<ConfigError> MavlinkConfig::check() const {
  const auto is_ipv4 = [](const std::string& text) { return net::parse_address(text).has_value(); };
  Checker all{"streaming.mavlink."};
  all.require(is_ipv4(address), "address", '"' + address + '"',
              "must be an IPv4 address, e.g. 0.0.0.0")
      .require(vehicles.size() <= 64, "vehicles", std::to_string(vehicles.size()) + " entries",
               "must be at most 64");
  std::set<std::pair<std::string, std::uint16_t>> peers;
  for (std::size_t i = 0; i < vehicles.size(); ++i) {
    const VehicleConfig& vehicle = vehicles[i];
    Checker one{"streaming.mavlink.vehicles." + std::to_string(i) + "."};
    one.require(!vehicle.body.empty(), "body", "\"\"", "must name one of the bodies")
        .require(is_ipv4(vehicle.address), "address", '"' + vehicle.address + '"',
                 "must be an IPv4 address")
        .require(vehicle.port > 0, "port", vehicle.port, "must be in [1, 65535]")
        .require(peers.emplace(vehicle.address, vehicle.port).second, "port", vehicle.port,
                 "is another vehicle's, too: each has an address of its own")
        .within("rate_hz", vehicle.rate_hz, 1, 200)
        .within("system_id", vehicle.system_id, 1, 255)
        .within("component_id", vehicle.component_id, 1, 255);
    all.errors.insert(all.errors.end(), one.errors.begin(), one.errors.end());
  }
  return all.errors;
}

ServedProtocol MavlinkConfig::served() const {
  const ProtocolConventions& conventions = conventions_of("mavlink");
  return {"mavlink", enabled, address, {{port, true}}, conventions.axes, conventions.when_invalid};
}

std::vector<ConfigError> MavlinkConfig::check_bodies(const std::vector<std::string>& names) const {
  std::vector<ConfigError> errors;
  for (std::size_t i = 0; i < vehicles.size(); ++i) {
    const std::string& name = vehicles[i].body;
    if (name.empty() || std::find(names.begin(), names.end(), name) != names.end()) continue;
    errors.push_back({"streaming.mavlink.vehicles." + std::to_string(i) + ".body", '"' + name + '"',
                      "must be the name of one of the bodies"});
  }
  return errors;
}

}  // namespace fiducap::mavlink
