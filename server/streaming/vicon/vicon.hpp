#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::vicon {

struct ViconConfig {
  bool enabled{false};               ///< False: not served. The usual port needs a permission.
  std::string address{"127.0.0.1"};  ///< IPv4 only. 0.0.0.0: all interfaces.
  std::uint16_t port{801};           ///< TCP. 0: any free one.
  int max_clients{64};               ///< Further clients are refused.
  int max_clients_per_address{32};   ///< Further clients of the same address are refused.
  WhenInvalid when_invalid{conventions_of("vicon").when_invalid};
  NameAliases aliases;  ///< Names for the clients, by name of the body.

  [[nodiscard]] std::vector<ConfigError> check() const;
  [[nodiscard]] ServedProtocol served() const;
};

template <class V>
void describe(V& v, ViconConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.word("when_invalid", c.when_invalid, words::kWhenInvalid);
  v.value("aliases", c.aliases);
}

using ProtocolConfig = ViconConfig;

/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] StartedStreamer serve(const ProtocolContext& context, const ViconConfig& config);

}  // namespace fiducap::vicon
