#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::native {

struct NativeConfig {
  bool enabled{true};                ///< False: this protocol is not served.
  std::string address{"127.0.0.1"};  ///< Where it listens. 0.0.0.0: all interfaces.
  std::uint16_t port{21600};         ///< UDP for frames, TCP for control. 0: any free one.
  int max_clients{64};               ///< Further clients are refused.
  int max_clients_per_address{16};   ///< Further clients of the same address are refused.
  double lease_s{3.0};               ///< A client that does not renew within this time is removed.
  bool discovery{true};              ///< Reply to clients that search for servers.
  bool control{true};                ///< Accept commands with `operator.token`.
  std::string multicast_group;  ///< E.g. 239.255.42.16, for clients that request it; empty: none.
  std::uint16_t multicast_port{21601};  ///< Of multicast frames.
  int multicast_ttl{1};                 ///< 1: this network only.
  std::string multicast_interface;  ///< IPv4 address of the interface; empty: the one of `address`.

  [[nodiscard]] std::vector<ConfigError> check() const;
  [[nodiscard]] ServedProtocol served() const;
};

template <class V>
void describe(V& v, NativeConfig& c) {
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

using ProtocolConfig = NativeConfig;

/// Native protocol (`proto/fiducap/v1/`): subscriptions with leases, frames by one UDP socket;
/// commands by TCP, unless there is no OperatorApi.
/// @return Error with the remedy when it cannot bind; `kInvalid` for too many bodies
[[nodiscard]] StartedStreamer serve(const ProtocolContext& context, const NativeConfig& config);

}  // namespace fiducap::native
