#include "streaming/qualisys/qualisys_config.hpp"

#include <algorithm>

#include "middleware/net/peer.hpp"
#include "streaming/qualisys/protocol.hpp"

namespace fiducap::qualisys {

namespace {

bool is_short_text(const std::string& text) {
  return !text.empty() && text.size() <= 60 &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= 0x20 && c < 0x7f; });
}

}  // namespace

std::vector<ConfigError> QualisysConfig::check() const {
  return Checker{"streaming.qualisys."}
      .require(net::parse_address(address).has_value(), "address", address,
               "must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all")
      .require(base_port <= 65535 - kBigEndianOffset, "base_port", std::to_string(base_port),
               "must leave room for the two ports behind it")
      .within("max_clients", max_clients, 1, 256)
      .within("max_clients_per_address", max_clients_per_address, 1, 256)
      .require(is_short_text(qtm_version), "qtm_version", qtm_version,
               "must be 1 to 60 printable characters")
      .errors;
}

ServedProtocol QualisysConfig::served() const {
  const auto tcp = [this](int offset) {
    return PortUse{static_cast<std::uint16_t>(base_port + offset), false};
  };
  // Bodies are known by index: the list is fixed.
  const bool stop = when_invalid == WhenInvalid::kStop;
  return {"qualisys", enabled,
          address,    {tcp(kLittleEndianOffset), tcp(kBigEndianOffset), {discovery_port, true}},
          axes(),     stop ? WhenInvalid::kFlag : when_invalid};
}

}  // namespace fiducap::qualisys
