#pragma once

#include <cstdint>
#include <vector>

#include "base/expected.hpp"
#include "middleware/network.hpp"

/// Cyclone DDS binds its receiving sockets to every address of the machine, whatever interface it
/// is told, and answers to whatever addresses a datagram claims. Here the kernel is told whom its
/// sockets hear.
namespace fiducap::dds {

/// IPv4 addresses with the same first bits; host byte order.
struct Ipv4Network {
  std::uint32_t address{};
  std::uint32_t mask{};

  [[nodiscard]] bool contains(std::uint32_t other) const { return (other & mask) == address; }
  bool operator==(const Ipv4Network&) const = default;
};

/// Whom the participant hears: this machine itself, the networks that the interface is attached
/// to, and peers that are named.
struct Neighbours {
  bool loopback_only{};
  unsigned interface_index{};         ///< 0: any interface.
  std::vector<Ipv4Network> networks;  ///< Sender addresses that are heard.
  /// Nobody else need be sent to: then no datagram leaves for an address beyond `networks`.
  bool attached_only{true};
};

/// As the machine's interfaces are now. Names of peers are looked up.
[[nodiscard]] Neighbours neighbours_of(const NetworkConfig& config);

/// Restricts this process's sockets at the ports of the domain to the neighbours, for good.
/// @return Error when there are none, or the system refuses
[[nodiscard]] Expected<void> fence_off(int domain, const Neighbours& neighbours);

}  // namespace fiducap::dds
