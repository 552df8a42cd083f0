#pragma once

#include <array>
#include <compare>
#include <cstdint>

namespace fiducap::native {

/// The other end of a datagram, without a socket type.
struct Peer {
  std::array<std::uint8_t, 16> address{};  ///< IPv6; IPv4 as ::ffff:a.b.c.d
  std::uint32_t scope{};                   ///< Of a link-local IPv6 address, else 0.
  std::uint16_t port{};

  [[nodiscard]] bool same_address(const Peer& other) const {
    return address == other.address && scope == other.scope;
  }
  auto operator<=>(const Peer&) const = default;
};

}  // namespace fiducap::native
