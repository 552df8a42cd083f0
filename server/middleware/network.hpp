#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"

namespace fiducap::dds {

/// How this process takes part in DDS. One for the whole process, shared by ROS sources and topics.
struct NetworkConfig {
  int domain{0};                   ///< ROS_DOMAIN_ID.
  std::string interface { "lo" };  ///< Name or address; empty: chosen by the middleware.
  std::vector<std::string> peers;  ///< Addresses to query; without multicast when there are any.
  int max_participants{20};  ///< Per machine without multicast: number of ports queried per peer.
  double announce_s{2.0};    ///< Period of the announcements.

  [[nodiscard]] bool is_loopback() const {
    return interface == "lo" || interface.starts_with("127.") || interface == "::1";
  }
  /// Discovery by multicast: not on loopback, and not with peers.
  [[nodiscard]] bool uses_multicast() const { return peers.empty() && !is_loopback(); }
  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// Longest message in bytes, both ways: an uncompressed colour image of 12 megapixels.
inline constexpr std::size_t kMaxMessage = 48u << 20;

/// IPv4 addresses with the same first bits; host byte order.
struct Ipv4Network {
  std::uint32_t address{};
  std::uint32_t mask{};

  [[nodiscard]] bool contains(std::uint32_t other) const { return (other & mask) == address; }
  bool operator==(const Ipv4Network&) const = default;
};

/// Senders whose datagrams reach the participant: this machine, attached networks, and peers.
struct AllowedSenders {
  bool loopback_only{};               ///< This machine, by any of its interfaces.
  std::vector<std::string> cards;     ///< With `loopback_only`: addresses from `local_cards`.
  unsigned interface_index{};         ///< 0: any interface.
  std::vector<Ipv4Network> networks;  ///< Of sender addresses.
  /// No peer is beyond the attached networks: no datagram need leave for an address beyond them.
  bool attached_only{true};
};

/// By the present interfaces of the machine. Looks up the names of peers.
[[nodiscard]] AllowedSenders allowed_senders(const NetworkConfig& config);

/// An address of each interface by which programs of this machine with their vendor's defaults may
/// be found: those that are up, not loopback, with multicast first; at most three, because Cyclone
/// DDS takes four interfaces.
[[nodiscard]] std::vector<std::string> local_cards();

/// Configuration of Cyclone DDS; replaces CYCLONEDDS_URI, which is not read. With `loopback_only`
/// announcements go by multicast to the cards as well, but do not leave the machine (TTL 0).
/// @pre config.check().empty()
[[nodiscard]] std::string cyclone_xml(const NetworkConfig& config, const AllowedSenders& senders);

/// Restricts this process's sockets at the ports of the domain to these senders, for good: Cyclone
/// DDS binds them to all addresses and answers to any address that a datagram claims.
/// @return Error when there are no such sockets, or the system refuses
[[nodiscard]] Expected<void> restrict_sockets(int domain, const AllowedSenders& senders);

}  // namespace fiducap::dds
