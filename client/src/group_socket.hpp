#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "src/udp_socket.hpp"

namespace fiducap::sdk {

/// Receives from one IPv4 multicast group; drops datagrams of other hosts than the server. Never
/// waits.
class GroupSocket {
 public:
  GroupSocket() = default;
  ~GroupSocket() { close(); }
  GroupSocket(const GroupSocket&) = delete;
  GroupSocket& operator=(const GroupSocket&) = delete;

  /// Joins on the interface that `towards_server` uses. @return false when this machine cannot (no
  /// IPv4, no route)
  bool open(const std::array<std::uint8_t, 4>& group, std::uint16_t port,
            const UdpSocket& towards_server);
  void close();
  bool is_open() const { return fd_ >= 0; }
  bool listens_to(const std::array<std::uint8_t, 4>& group, std::uint16_t port) const {
    return is_open() && group == group_ && port == port_;
  }
  int descriptor() const { return fd_; }
  /// @return false when there is none
  bool receive(std::uint8_t* bytes, std::size_t& size);
  std::uint32_t dropped() const { return dropped_; }

 private:
  int fd_{-1};
  std::array<std::uint8_t, 4> group_{};
  std::uint16_t port_{0};
  std::uint32_t server_{0};  ///< Address, network order.
  std::uint32_t dropped_{0};
};

}  // namespace fiducap::sdk
