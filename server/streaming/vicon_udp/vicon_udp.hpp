#pragma once

#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::vicon_udp {

struct ViconUdpConfig {
  bool enabled{false};  ///< False: this protocol is not sent.
  /// Receivers, `ip:port`; also a broadcast address, e.g. 192.168.1.255:51001.
  std::vector<std::string> targets{"127.0.0.1:51001"};
  int block_bytes{256};  ///< Of a datagram: 256, 512 or 1024, with 3, 6 or 13 bodies.
  /// `stop` or `hold`: the protocol has no flag for invalid poses.
  WhenInvalid when_invalid{conventions_of("vicon_udp").when_invalid};
  NameAliases aliases;  ///< Names for the receivers, by name of the body.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

template <class V>
void describe(V& v, ViconUdpConfig& c) {
  v.value("enabled", c.enabled);
  v.value("targets", c.targets);
  v.value("block_bytes", c.block_bytes);
  v.word("when_invalid", c.when_invalid, words::kWhenInvalid);
  v.value("aliases", c.aliases);
}

using ProtocolConfig = ViconUdpConfig;

/// Sends each frame to all targets; receives nothing.
/// @return Error `kUnavailable` when there is no socket
[[nodiscard]] StartedStreamer serve(const ProtocolContext& context, const ViconUdpConfig& config);

}  // namespace fiducap::vicon_udp
