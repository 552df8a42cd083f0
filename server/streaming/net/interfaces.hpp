#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "middleware/net/peer.hpp"

namespace fiducap::net {

/// An IPv4 network card that is up, not the loopback.
struct Card {
  std::string name;
  std::uint32_t address{};    ///< a.b.c.d as 0xaabbccdd
  std::uint32_t broadcast{};  ///< 0: none
  bool multicast{};
};

[[nodiscard]] std::vector<Card> network_cards();
/// Is it an IPv4 address of this machine?
[[nodiscard]] bool is_this_machine(const Peer& peer);
/// This machine's, as it calls itself.
[[nodiscard]] std::string host_name();
/// Where broadcasts of its networks go that a socket bound to `own` does not hear; e.g.
/// `10.0.0.255`.
[[nodiscard]] std::vector<std::string> subnet_broadcasts(std::uint32_t own);

}  // namespace fiducap::net
