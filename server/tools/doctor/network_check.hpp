#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace fiducap {

/// One IPv4 address of this machine.
struct NetworkInterface {
  std::string name;
  std::string address;
  bool up{};
  bool loopback{};
  bool multicast{};  ///< As the kernel says.
};

[[nodiscard]] std::vector<NetworkInterface> network_interfaces();

/// Sends one datagram to a multicast group through an interface and waits for it to come back.
/// @return nullopt when it came; else why not, in one sentence
[[nodiscard]] std::optional<std::string> multicast_fault(const NetworkInterface& interface);

enum class Transport { kTcp, kUdp };

/// A socket that waits for somebody on this machine.
struct ListeningPort {
  Transport transport{};
  std::string address;  ///< 0.0.0.0: every interface.
  std::uint16_t port{};
  unsigned long inode{};  ///< The kernel's number of the socket.
  std::string owner{};    ///< `vrpn_server (process 812)`; empty: not ours to see.
};

/// IPv4 and IPv6, as /proc says it; empty where there is no such folder.
[[nodiscard]] std::vector<ListeningPort> listening_ports();

/// One line of /proc/net/tcp or udp (RFC-less: `sl local_address rem_address st …`). @return
/// nullopt for the header, for connections, and for lines of another shape
[[nodiscard]] std::optional<ListeningPort> listening_port_of(const std::string& line,
                                                             Transport transport);

}  // namespace fiducap
