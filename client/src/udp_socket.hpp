#pragma once

#include <sys/socket.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace fiducap::sdk {

struct Address {
  sockaddr_storage bytes{};
  socklen_t size{};
};

/// A UDP socket that is connected to one server. Never waits.
class UdpSocket {
 public:
  UdpSocket() = default;
  ~UdpSocket() { close(); }
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket& operator=(const UdpSocket&) = delete;

  /// @return empty, or the cause of the failure
  std::string open(const Address& server);
  void close();
  bool is_open() const { return fd_ >= 0; }
  int descriptor() const { return fd_; }
  /// The server runs on this machine: its monotonic clock is ours.
  bool server_is_local() const { return server_is_local_; }

  enum class Result { kDone, kNothing, kRefused };
  Result send(const std::uint8_t* bytes, std::size_t size);
  template <typename Bytes>
  Result send(const Bytes& datagram) {
    return send(datagram.data(), datagram.size());
  }
  /// @param size  in: room; out: bytes of the datagram, never more than the room
  Result receive(std::uint8_t* bytes, std::size_t& size);
  /// Datagrams dropped because the buffer was full, as of the last `receive`; reset by `open`.
  std::uint32_t dropped() const { return dropped_; }

 private:
  int fd_{-1};
  std::uint32_t dropped_{0};
  bool server_is_local_{false};
};

}  // namespace fiducap::sdk
