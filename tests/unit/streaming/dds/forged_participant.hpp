#pragma once

#include <gtest/gtest.h>
#include <poll.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "support/hex.hpp"
#include "support/loopback_socket.hpp"

namespace fiducap::dds {

/// A UDP socket in the namespace of the thread that makes it.
class Socket final {
 public:
  explicit Socket(const std::string& address, int port = 0) {
    const int yes = 1;
    ::setsockopt(fd_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    const auto own = ipv4(address, port);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)), 0) << address;
  }
  ~Socket() { ::close(fd_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  void join(const std::string& group, const std::string& interface) const {
    const ip_mreq wanted{ipv4(group, 0).sin_addr, ipv4(interface, 0).sin_addr};
    EXPECT_EQ(::setsockopt(fd_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &wanted, sizeof(wanted)), 0);
    EXPECT_EQ(::setsockopt(fd_, IPPROTO_IP, IP_MULTICAST_IF, &wanted.imr_interface,
                           sizeof(wanted.imr_interface)),
              0);
  }
  void set_multicast_ttl(int ttl) const {
    EXPECT_EQ(::setsockopt(fd_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof(ttl)), 0);
  }
  [[nodiscard]] int port() const { return port_of(fd_); }
  void send(const std::vector<std::byte>& bytes, const std::string& address, int port) const {
    const auto to = ipv4(address, port);
    EXPECT_EQ(::sendto(fd_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                       sizeof(to)),
              static_cast<ssize_t>(bytes.size()));
  }
  [[nodiscard]] bool hears_within(int timeout_ms) const {
    pollfd readable{fd_, POLLIN, 0};
    return ::poll(&readable, 1, timeout_ms) == 1;
  }
  [[nodiscard]] bool has_heard() const { return hears_within(0); }

 private:
  int fd_{::socket(AF_INET, SOCK_DGRAM, 0)};
};

/// SPDP, little-endian, of a participant whose addresses are the victim's.
inline std::vector<std::byte> announcement(std::uint32_t number, const std::string& victim,
                                           int port) {
  const auto hex = [](const auto& value) {
    const auto bytes = std::as_bytes(std::span(&value, 1));
    return to_hex({bytes.begin(), bytes.end()});
  };
  const std::string prefix = "0110 666f72676564" + hex(htonl(number));  // "forged"
  const std::string locator =
      "01000000" + hex(port) + std::string(24, '0') + hex(ipv4(victim, 0).sin_addr.s_addr);
  const std::string participant = "50001000" + prefix + "000001c1";
  const std::string addresses = "31001800" + locator + "32001800" + locator;
  // DATA of 140 bytes: protocol version, vendor, lease of 20 s, …, builtin endpoints, end.
  return from_hex("52545053 02010110" + prefix +
                  "15058c00 00001000 00000000 000100c2 00000000 01000000 00030000"
                  "15000400 02010000 16000400 01100000 02000800 1400000000000000" +
                  participant + addresses + "58000400 3f0c0000 01000000");
}

}  // namespace fiducap::dds
