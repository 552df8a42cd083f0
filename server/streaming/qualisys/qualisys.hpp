#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::qualisys {

struct QualisysConfig {
  bool enabled{false};               ///< False: this protocol is not served.
  std::string address{"127.0.0.1"};  ///< IPv4. 0.0.0.0: all interfaces.
  /// TCP: this one for protocol 1.0, +1 little-endian, +2 big-endian. 0: any free ones.
  std::uint16_t base_port{22222};
  std::uint16_t discovery_port{22226};  ///< UDP, for discovery by broadcast. 0: none.
  int max_clients{64};                  ///< Further clients are refused.
  int max_clients_per_address{32};      ///< Further clients of the same address are refused.
  UpAxis up{UpAxis::kZ};
  AxesScope scope{AxesScope::kWorld};
  /// `hold`: the last valid pose instead of NaN. Bodies are identified by index: `stop` is `flag`.
  WhenInvalid when_invalid{WhenInvalid::kFlag};
  NameAliases aliases;                           ///< Names for the clients, by name of the body.
  std::string qtm_version{"2.17 (build 4050)"};  ///< For QTMVersion and discovery.

  [[nodiscard]] OutputAxes axes() const { return {up, scope, 1000.0}; }
  [[nodiscard]] std::vector<ConfigError> check() const;
  [[nodiscard]] ServedProtocol served() const;
};

template <class V>
void describe(V& v, QualisysConfig& c) {
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

using ProtocolConfig = QualisysConfig;

/// Without an OperatorApi no client can take control. The base port is the Streamer's port.
/// @return Error `kUnavailable` naming port and remedy when it cannot bind.
[[nodiscard]] StartedStreamer serve(const ProtocolContext& context, const QualisysConfig& config);

}  // namespace fiducap::qualisys
