#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <vector>

namespace fiducap::dds {

inline sockaddr_in ipv4(const std::string& address, int port) {
  sockaddr_in all{};
  all.sin_family = AF_INET;
  all.sin_port = htons(static_cast<std::uint16_t>(port));
  EXPECT_EQ(::inet_pton(AF_INET, address.c_str(), &all.sin_addr), 1) << address;
  return all;
}

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
  [[nodiscard]] int port() const {
    sockaddr_in own{};
    socklen_t size = sizeof(own);
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&own), &size);
    return ntohs(own.sin_port);
  }
  void send(const std::vector<std::uint8_t>& bytes, const std::string& address, int port) const {
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

inline void add_parameter(std::vector<std::uint8_t>& to, int id,
                          const std::vector<std::uint8_t>& value) {
  to.insert(to.end(),
            {static_cast<std::uint8_t>(id), 0, static_cast<std::uint8_t>(value.size()), 0});
  to.insert(to.end(), value.begin(), value.end());
}

/// SPDP, little-endian, of a participant whose addresses are the victim's.
inline std::vector<std::uint8_t> announcement(std::uint32_t number, const std::string& victim,
                                              int port) {
  const auto byte = [number](int shift) { return static_cast<std::uint8_t>(number >> shift); };
  const std::vector<std::uint8_t> prefix{1,   0x10, 'f',      'o',      'r',     'g',
                                         'e', 'd',  byte(24), byte(16), byte(8), byte(0)};
  std::vector<std::uint8_t> guid = prefix;
  guid.insert(guid.end(), {0, 0, 1, 0xc1});
  std::vector<std::uint8_t> locator{
      1, 0, 0, 0, static_cast<std::uint8_t>(port), static_cast<std::uint8_t>(port >> 8)};
  locator.resize(20);
  const auto address = ipv4(victim, 0).sin_addr;
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&address);
  locator.insert(locator.end(), bytes, bytes + 4);
  std::vector<std::uint8_t> list{0, 3, 0, 0};
  add_parameter(list, 0x15, {2, 1, 0, 0});               // protocol version
  add_parameter(list, 0x16, {1, 0x10, 0, 0});            // vendor
  add_parameter(list, 0x02, {20, 0, 0, 0, 0, 0, 0, 0});  // lease, s
  add_parameter(list, 0x50, guid);
  add_parameter(list, 0x31, locator);             // default unicast
  add_parameter(list, 0x32, locator);             // metatraffic unicast
  add_parameter(list, 0x58, {0x3f, 0x0c, 0, 0});  // builtin endpoints
  add_parameter(list, 0x01, {});                  // end
  std::vector<std::uint8_t> data{0, 0, 16, 0, 0, 0, 0, 0, 0, 1, 0, 0xc2, 0, 0, 0, 0, 1, 0, 0, 0};
  data.insert(data.end(), list.begin(), list.end());
  std::vector<std::uint8_t> message{'R', 'T', 'P', 'S', 2, 1, 1, 0x10};
  message.insert(message.end(), prefix.begin(), prefix.end());
  message.insert(message.end(), {0x15, 5, static_cast<std::uint8_t>(data.size()), 0});
  message.insert(message.end(), data.begin(), data.end());
  return message;
}

}  // namespace fiducap::dds
