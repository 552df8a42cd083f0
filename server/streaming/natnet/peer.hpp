#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>

namespace fiducap::natnet {

/// An IPv4 address and port, without a socket type. NatNet knows no IPv6.
struct Peer {
  std::uint32_t address{};  ///< a.b.c.d as 0xaabbccdd
  std::uint16_t port{};

  [[nodiscard]] bool is_loopback() const { return address >> 24 == 127; }
  auto operator<=>(const Peer&) const = default;
};

/// a.b.c.d as 0xaabbccdd. @return nullopt for any other text
[[nodiscard]] std::optional<std::uint32_t> parse_address(const std::string& text);
/// `10.0.0.7:1511`. @return nullopt for any other text
[[nodiscard]] std::optional<Peer> parse_peer(const std::string& text);
[[nodiscard]] std::string text_of(const Peer& peer);

}  // namespace fiducap::natnet
