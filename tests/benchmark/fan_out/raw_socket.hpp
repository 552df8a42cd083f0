#pragma once

#include <netinet/in.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

/// What a client on a raw socket needs: loopback, nothing waits.
namespace fiducap::fan_out {

[[nodiscard]] sockaddr_in loopback(std::uint16_t port);
/// A non-blocking socket with a large receive buffer. A stream is connected, a datagram socket
/// bound to a free port.
/// @throws std::runtime_error when nobody is there
[[nodiscard]] int open_socket(int type, std::uint16_t port);
[[nodiscard]] std::uint16_t local_port(int fd);
/// @throws std::runtime_error when the bytes do not go at once
void send_all(int fd, std::span<const std::byte> bytes);
void send_to(int fd, const sockaddr_in& to, std::span<const std::byte> bytes);

void put32(std::vector<std::byte>& out, std::uint32_t little_endian);
void put16(std::vector<std::byte>& out, std::uint16_t little_endian);
[[nodiscard]] std::span<const std::byte> bytes_of(const std::string& text);

}  // namespace fiducap::fan_out
