#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "daemon/config/config_file.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap {

/// A socket that a configuration opens. Those of DDS are not listed: it chooses them itself.
struct OwnSocket {
  std::string section;  ///< `streaming.native`, `bodies.0.imu_source`
  std::string address;
  PortUse port;

  /// `streaming.native.port`
  [[nodiscard]] std::string key() const { return section + "." + std::string(port.key); }
  /// The configured value of the key.
  [[nodiscard]] std::string value() const { return std::to_string(port.number - port.offset); }
  /// The two cannot be open at once.
  [[nodiscard]] bool collides_with(const OwnSocket& other) const;
};

/// 0.0.0.0, or its like of IPv6.
[[nodiscard]] bool is_any(std::string_view address);
/// `3883 udp`
[[nodiscard]] std::string text_of(const PortUse& port);

/// Every protocol with sockets: where it listens, and what its clients receive.
[[nodiscard]] std::vector<ServedProtocol> served_protocols(const StreamingConfig& streaming);
[[nodiscard]] std::vector<OwnSocket> sockets_of(const ServedProtocol& protocol);
/// Of every enabled protocol and every IMU over UDP: the one list, for the rules of a
/// configuration, its review, and `fiducap doctor`.
[[nodiscard]] std::vector<OwnSocket> sockets_of(const ServerConfig& config);

}  // namespace fiducap
