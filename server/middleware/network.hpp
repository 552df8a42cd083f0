#pragma once

#include <string>
#include <vector>

#include "base/config_check.hpp"

namespace fiducap::dds {

/// How this process takes part in DDS. One for the whole process: ROS sources and ROS topics share
/// it.
struct NetworkConfig {
  int domain{0};  ///< ROS_DOMAIN_ID.
  std::string interface {
    "lo"
  };  ///< Name or address; empty: the middleware takes the one it likes best.
  std::vector<std::string>
      peers;  ///< Addresses that are asked directly: no multicast is needed or used then.
  int max_participants{
      20};  ///< Per machine, when multicast is not used: so many ports are asked at each peer.
  double announce_s{2.0};  ///< How often we say that we are there.

  [[nodiscard]] bool is_loopback() const;
  /// Others are found by multicast: not on loopback, and not when peers are named.
  [[nodiscard]] bool uses_multicast() const;
  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// Bytes of the longest message that passes in or out: an uncompressed 12-megapixel image in
/// colour.
inline constexpr std::size_t kMaxMessage = 48u << 20;

/// The same in the words of Cyclone DDS. It stands in for CYCLONEDDS_URI, which is not read.
/// @pre config.check().empty()
/// @param attached_only  nothing is sent beyond the networks that the interface is attached to,
/// whatever address a datagram claims for its sender
[[nodiscard]] std::string cyclone_xml(const NetworkConfig& config, bool attached_only);

}  // namespace fiducap::dds
