#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace fiducap::net {

/// Local address and port of a protocol, with the configuration keys that set them.
struct BindTarget {
  std::string address;   ///< IP address of one interface, or 0.0.0.0.
  std::uint16_t port{};  ///< 0: any free port.
  std::string_view key;  ///< Section of the configuration, e.g. `streaming.natnet`.
  std::string_view port_key{"port"};
};

/// Address and port of the other end of a connection or datagram.
struct Peer {
  using Address = std::array<std::uint8_t, 16>;

  Address address{};      ///< IPv6; IPv4 as ::ffff:a.b.c.d
  std::uint32_t scope{};  ///< Of a link-local IPv6 address, else 0.
  std::uint16_t port{};

  constexpr Peer() = default;
  constexpr Peer(const Address& host, std::uint16_t at) : address(host), port(at) {}
  /// @param ipv4  a.b.c.d as 0xaabbccdd
  constexpr Peer(std::uint32_t ipv4, std::uint16_t at) : port(at) {
    address[10] = address[11] = 0xff;
    for (std::size_t i = 0; i < 4; ++i)
      address[12 + i] = static_cast<std::uint8_t>(ipv4 >> (24 - 8 * i));
  }

  [[nodiscard]] bool is_ipv4() const;
  /// a.b.c.d as 0xaabbccdd. @pre is_ipv4()
  [[nodiscard]] std::uint32_t ipv4() const {
    return std::uint32_t{address[12]} << 24 | std::uint32_t{address[13]} << 16 |
           std::uint32_t{address[14]} << 8 | address[15];
  }
  [[nodiscard]] bool is_loopback() const;
  [[nodiscard]] bool same_address(const Peer& other) const {
    return address == other.address && scope == other.scope;
  }
  [[nodiscard]] Peer with_port(std::uint16_t other) const {
    Peer peer = *this;
    peer.port = other;
    return peer;
  }
  auto operator<=>(const Peer&) const = default;
};

/// a.b.c.d as 0xaabbccdd. @return nullopt for any other text
[[nodiscard]] std::optional<std::uint32_t> parse_address(const std::string& text);
[[nodiscard]] bool is_address(const std::string& text);  ///< IPv4 or IPv6.
/// `10.0.0.7:1511`. @return nullopt for any other text
[[nodiscard]] std::optional<Peer> parse_peer(const std::string& text);
/// `10.0.0.7`, `2001:db8::7`
[[nodiscard]] std::string address_text(const Peer& peer);
/// `10.0.0.7:1511`, `[2001:db8::7]:1511`
[[nodiscard]] std::string text_of(const Peer& peer);

/// A peer in the form of the socket API.
class SocketAddress final {
 public:
  SocketAddress() = default;
  SocketAddress(const sockaddr* address, socklen_t size);
  /// @param ipv4  for a socket of IPv4
  SocketAddress(const Peer& peer, bool ipv4);

  [[nodiscard]] Peer peer() const;
  [[nodiscard]] sockaddr* data() { return &any_.general; }
  [[nodiscard]] socklen_t size() const { return size_; }
  static constexpr socklen_t kCapacity = sizeof(sockaddr_in6);

 private:
  union Any {
    sockaddr_in6 v6;
    sockaddr_in v4;
    sockaddr general;
  };
  Any any_{};
  socklen_t size_{kCapacity};
};

/// Keyed hash of short inputs: SipHash-2-4 (J.-P. Aumasson, D. J. Bernstein, 2012).
[[nodiscard]] std::uint64_t siphash(const std::array<std::uint64_t, 2>& key,
                                    std::span<const std::uint8_t> data);
/// From the system's source of randomness.
[[nodiscard]] std::uint64_t random_word();
[[nodiscard]] std::array<std::uint64_t, 2> random_key();
/// 128 random bits, hexadecimal.
[[nodiscard]] std::string random_secret();

/// Keyed hash of an address, for tables whose collisions an attacker must not choose. Without the
/// port; of IPv6 the network only, since one host owns all 2^64 addresses of its network.
[[nodiscard]] std::uint64_t address_hash(const std::array<std::uint64_t, 2>& key, const Peer& peer);
/// Keyed hash of address and port.
[[nodiscard]] std::uint64_t peer_hash(const std::array<std::uint64_t, 2>& key, const Peer& peer);

}  // namespace fiducap::net
