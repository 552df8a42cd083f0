#pragma once

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

/// Plain non-blocking sockets on 127.0.0.1, for clients that share no code with the server.
namespace fiducap {

inline sockaddr_in ipv4(const std::string& address, int port) {
  sockaddr_in all{};
  all.sin_family = AF_INET;
  all.sin_port = htons(static_cast<std::uint16_t>(port));
  if (::inet_pton(AF_INET, address.c_str(), &all.sin_addr) != 1)
    throw std::invalid_argument("no IPv4 address: " + address);
  return all;
}
inline sockaddr_in loopback(std::uint16_t port) { return ipv4("127.0.0.1", port); }

/// On a port that the kernel chooses. @param type  SOCK_STREAM or SOCK_DGRAM
inline int bound_socket(int type) {
  const int fd = ::socket(AF_INET, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const sockaddr_in any = loopback(0);
  if (fd < 0 || ::bind(fd, reinterpret_cast<const sockaddr*>(&any), sizeof(any)) != 0)
    throw std::runtime_error("cannot bind to the loopback");
  return fd;
}

inline int connected_socket(std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in server = loopback(port);
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&server), sizeof(server)) != 0)
    throw std::runtime_error("cannot connect on the loopback");
  ::fcntl(fd, F_SETFL, ::fcntl(fd, F_GETFL) | O_NONBLOCK);
  return fd;
}

inline std::uint16_t port_of(int fd) {
  sockaddr_in address{};
  socklen_t size = sizeof(address);
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.sin_port);
}

/// Appends all that came. @return false: closed by the other side
template <typename Byte>
[[nodiscard]] bool read_stream(int fd, std::vector<Byte>& in) {
  Byte buffer[65536];
  for (;;) {
    const ssize_t n = ::recv(fd, buffer, sizeof(buffer), 0);
    if (n <= 0) return n < 0 && (errno == EAGAIN || errno == EINTR);
    in.insert(in.end(), buffer, buffer + n);
  }
}

template <typename Byte = std::byte>
[[nodiscard]] std::optional<std::vector<Byte>> read_datagram(int fd) {
  Byte buffer[65536];
  const ssize_t n = ::recv(fd, buffer, sizeof(buffer), 0);
  if (n < 0) return std::nullopt;
  return std::vector<Byte>(buffer, buffer + n);
}

inline void send_datagram(int fd, std::span<const std::byte> bytes, std::uint16_t port) {
  const sockaddr_in to = loopback(port);
  ::sendto(fd, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof(to));
}

}  // namespace fiducap
