#include "middleware/fence.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <linux/filter.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <optional>
#include <string>

#include "base/open_descriptors.hpp"

namespace fiducap::dds {

namespace {

// RTPS: the ports of a domain follow each other.
constexpr int kFirstPort = 7400;
constexpr int kPortsPerDomain = 250;

constexpr std::uint32_t kOffsetOfSource = 12;  // in an IPv4 header

std::uint32_t address_of(const sockaddr* address) {
  return ntohl(reinterpret_cast<const sockaddr_in*>(address)->sin_addr.s_addr);
}

bool is_named(const ifaddrs& card, const std::string& interface) {
  char text[INET_ADDRSTRLEN]{};
  const auto& address = reinterpret_cast<const sockaddr_in*>(card.ifa_addr)->sin_addr;
  return interface == card.ifa_name ||
         interface == ::inet_ntop(AF_INET, &address, text, sizeof(text));
}

/// Networks of one interface, or of all; loopback is heard without being among them.
void add_attached(Neighbours& to, const std::string& interface) {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return;
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(first, &::freeifaddrs);
  const auto is_ipv4 = [](const ifaddrs& card) {
    return card.ifa_addr != nullptr && card.ifa_netmask != nullptr &&
           card.ifa_addr->sa_family == AF_INET && (card.ifa_flags & IFF_UP) != 0;
  };
  std::string name;
  for (const ifaddrs* one = first; one != nullptr && name.empty(); one = one->ifa_next)
    if (is_ipv4(*one) && is_named(*one, interface)) name = one->ifa_name;
  if (!name.empty()) to.interface_index = ::if_nametoindex(name.c_str());
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    if (!is_ipv4(*one) || (one->ifa_flags & IFF_LOOPBACK) != 0) continue;
    if (!interface.empty() && name != one->ifa_name) continue;
    const std::uint32_t mask = address_of(one->ifa_netmask);
    to.networks.push_back({address_of(one->ifa_addr) & mask, mask});
  }
}

/// `host`, `192.168.1.7` or either with a port.
std::vector<std::uint32_t> look_up(std::string peer) {
  if (std::count(peer.begin(), peer.end(), ':') == 1) peer.resize(peer.find(':'));
  addrinfo wanted{};
  wanted.ai_family = AF_INET;
  wanted.ai_socktype = SOCK_DGRAM;
  addrinfo* first = nullptr;
  if (::getaddrinfo(peer.c_str(), nullptr, &wanted, &first) != 0) return {};
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(first, &::freeaddrinfo);
  std::vector<std::uint32_t> found;
  for (const addrinfo* one = first; one != nullptr; one = one->ai_next)
    found.push_back(address_of(one->ai_addr));
  return found;
}

void add_peer(Neighbours& to, std::uint32_t peer) {
  const bool is_attached =
      peer >> 24 == IN_LOOPBACKNET ||
      std::any_of(to.networks.begin(), to.networks.end(),
                  [peer](const Ipv4Network& network) { return network.contains(peer); });
  if (is_attached) return;
  to.attached_only = false;
  to.networks.push_back({peer, INADDR_NONE});
}

/// The port of an IPv4 UDP socket. @return nullopt for any other descriptor
std::optional<int> udp_port(int descriptor) {
  sockaddr_in own{};
  socklen_t size = sizeof(own);
  int type = 0;
  socklen_t type_size = sizeof(type);
  if (::getsockopt(descriptor, SOL_SOCKET, SO_TYPE, &type, &type_size) != 0 || type != SOCK_DGRAM ||
      ::getsockname(descriptor, reinterpret_cast<sockaddr*>(&own), &size) != 0 ||
      own.sin_family != AF_INET)
    return std::nullopt;
  return ntohs(own.sin_port);
}

std::vector<int> sockets_of(int domain) {
  const int first = kFirstPort + domain * kPortsPerDomain;
  std::vector<int> found;
  for (const int descriptor : open_descriptors()) {
    const auto port = udp_port(descriptor);
    if (port && *port >= first && *port < first + kPortsPerDomain) found.push_back(descriptor);
  }
  return found;
}

/// A program for the kernel, run for each datagram: came it from this machine, or in through the
/// interface from a neighbour's address?
std::vector<sock_filter> admission(const Neighbours& neighbours) {
  const sock_filter let_in = BPF_STMT(BPF_RET | BPF_K, 0xffffffff);
  const sock_filter drop = BPF_STMT(BPF_RET | BPF_K, 0);
  const auto interface = static_cast<std::uint32_t>(SKF_AD_OFF + SKF_AD_IFINDEX);
  const auto source = static_cast<std::uint32_t>(SKF_NET_OFF) + kOffsetOfSource;
  std::vector<sock_filter> program{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, interface),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ::if_nametoindex("lo"), 0, 1),
      let_in,
  };
  if (neighbours.interface_index != 0) {
    program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, neighbours.interface_index, 1, 0));
    program.push_back(drop);
  }
  for (const Ipv4Network& network : neighbours.networks) {
    program.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, source));
    program.push_back(BPF_STMT(BPF_ALU | BPF_AND | BPF_K, network.mask));
    program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, network.address, 0, 1));
    program.push_back(let_in);
  }
  program.push_back(drop);
  return program;
}

bool hear_loopback_only(int socket) {
  constexpr char kLoopback[] = "lo";
  return ::setsockopt(socket, SOL_SOCKET, SO_BINDTODEVICE, kLoopback, sizeof(kLoopback)) == 0;
}

bool hear_only(int socket, std::vector<sock_filter>& program) {
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  return ::setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof(filter)) == 0;
}

}  // namespace

Neighbours neighbours_of(const NetworkConfig& config) {
  Neighbours found;
  found.loopback_only = config.is_loopback();
  if (found.loopback_only) return found;
  add_attached(found, config.interface);
  for (const std::string& peer : config.peers)
    for (const std::uint32_t address : look_up(peer)) add_peer(found, address);
  return found;
}

Expected<void> fence_off(int domain, const Neighbours& neighbours) {
  const std::string where = "domain " + std::to_string(domain);
  const std::vector<int> sockets = sockets_of(domain);
  if (sockets.empty())
    return fail(ErrorCode::kUnavailable, "the sockets of DDS cannot be found in /proc/self/fd",
                where);
  auto program = admission(neighbours);
  for (const int socket : sockets) {
    if (neighbours.loopback_only ? hear_loopback_only(socket) : hear_only(socket, program))
      continue;
    return fail(ErrorCode::kUnavailable,
                std::string("the sockets of DDS cannot be kept from other networks: ") +
                    std::strerror(errno) + " (needs Linux 5.7)",
                where);
  }
  return {};
}

}  // namespace fiducap::dds
