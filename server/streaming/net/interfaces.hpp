#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "middleware/net/peer.hpp"

namespace fiducap::net {

/// An IPv4 interface that is up; never the loopback.
struct Interface {
  std::string name;
  std::uint32_t address{};    ///< a.b.c.d as 0xaabbccdd
  std::uint32_t broadcast{};  ///< 0: none
  bool multicast{};
};

[[nodiscard]] std::vector<Interface> ipv4_interfaces();
/// @return the peer has an address of this machine
[[nodiscard]] bool is_this_machine(const Peer& peer);
/// Of this machine.
[[nodiscard]] std::string host_name();
/// Broadcast addresses of the networks of `own`, e.g. `10.0.0.255`; not received by its sockets.
[[nodiscard]] std::vector<std::string> subnet_broadcasts(std::uint32_t own);

}  // namespace fiducap::net
