#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace fiducap::net {

enum class Transport { kTcp, kUdp };

/// A listening socket of this machine.
struct ListeningPort {
  Transport transport{};
  std::string address;  ///< 0.0.0.0: every interface.
  std::uint16_t port{};
  unsigned long inode{};  ///< The kernel's number of the socket.
  std::string owner{};    ///< `vrpn_server (process 812)`; empty: of another user.
  /// UDP: datagrams that were discarded since it was opened, because its program read too slowly.
  std::uint64_t discarded{};
};

/// IPv4 and IPv6, from /proc; empty where there is no such folder.
[[nodiscard]] std::vector<ListeningPort> listening_ports();

/// One line of /proc/net/tcp or udp (`sl local_address rem_address st …`).
/// @return nullopt for the header, for connections, and for lines of another shape
[[nodiscard]] std::optional<ListeningPort> listening_port_of(const std::string& line,
                                                             Transport transport);

/// Who uses a port: `vrpn_server (process 812)`, `this process itself`, or, where the kernel does
/// not tell, `a program of another user`.
[[nodiscard]] std::string owner_of(std::uint16_t port, Transport transport);

}  // namespace fiducap::net
