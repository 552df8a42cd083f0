#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <utility>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>

#include "daemon/system.hpp"
#include "tools/doctor/doctor.hpp"

namespace fiducap {
namespace {

constexpr const char* kGroup = "239.255.70.67";  // site-local, unassigned
constexpr int kMulticastTimeout_ms = 300;

std::string system_text() { return std::strerror(errno); }

/// Address and port of /proc/net: hexadecimal, the address in the machine's byte order.
std::optional<std::pair<std::string, std::uint16_t>> endpoint_of(const std::string& text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos || (colon != 8 && colon != 32)) return std::nullopt;
  if (text.find_first_not_of("0123456789ABCDEFabcdef:") != std::string::npos) return std::nullopt;
  const auto port = static_cast<std::uint16_t>(std::strtoul(text.c_str() + colon + 1, nullptr, 16));
  std::array<std::uint32_t, 4> words{};
  for (std::size_t i = 0; i < colon / 8; ++i)
    words.at(i) =
        static_cast<std::uint32_t>(std::strtoul(text.substr(8 * i, 8).c_str(), nullptr, 16));
  std::array<char, INET6_ADDRSTRLEN> name{};
  ::inet_ntop(colon == 8 ? AF_INET : AF_INET6, words.data(), name.data(), name.size());
  return std::pair(std::string(name.data()), port);
}

/// Owners of sockets by inode, of the processes that this user may inspect.
std::map<unsigned long, std::string> socket_owners() {
  namespace fs = std::filesystem;
  constexpr std::string_view kSocket = "socket:[";
  std::map<unsigned long, std::string> owners;
  std::error_code gone;
  for (const auto& process : fs::directory_iterator("/proc", gone)) {
    const std::string pid = process.path().filename();
    if (pid.find_first_not_of("0123456789") != std::string::npos) continue;
    std::string name;
    std::getline(std::ifstream(process.path() / "comm"), name);
    for (const auto& file : fs::directory_iterator(process.path() / "fd", gone)) {
      const std::string target = fs::read_symlink(file.path(), gone).string();
      if (target.rfind(kSocket, 0) == 0)
        owners[std::strtoul(target.c_str() + kSocket.size(), nullptr, 10)] =
            name + " (process " + pid + ")";
    }
  }
  return owners;
}

constexpr std::size_t kMost_bytes = 4u << 20;

bool connect_to(const Descriptor& connection, const addrinfo& address,
                std::chrono::milliseconds timeout) {
  const timeval wait{timeout.count() / 1000, (timeout.count() % 1000) * 1000};
  return connection.number() >= 0 &&
         ::setsockopt(connection.number(), SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait) == 0 &&
         ::setsockopt(connection.number(), SOL_SOCKET, SO_SNDTIMEO, &wait, sizeof wait) == 0 &&
         ::connect(connection.number(), address.ai_addr, address.ai_addrlen) == 0;
}

Expected<std::string> ask(int fd, const std::string& request) {
  if (::send(fd, request.data(), request.size(), MSG_NOSIGNAL) !=
      static_cast<ssize_t>(request.size()))
    return fail(ErrorCode::kClosed, "does not accept the request");
  std::string answer;
  std::array<char, 16384> part{};
  for (;;) {
    const ssize_t n = ::recv(fd, part.data(), part.size(), 0);
    if (n == 0) return answer;
    if (n < 0) return fail(ErrorCode::kUnavailable, std::strerror(errno));
    answer.append(part.data(), static_cast<std::size_t>(n));
    if (answer.size() > kMost_bytes) return fail(ErrorCode::kInvalid, "sends more than 4 MB");
  }
}

Expected<std::string> body_of(const std::string& answer) {
  const auto end = answer.find("\r\n\r\n");
  if (answer.rfind("HTTP/1.", 0) != 0 || answer.size() < 12 || end == std::string::npos)
    return fail(ErrorCode::kInvalid, "does not speak HTTP");
  if (answer.substr(9, 3) != "200")
    return fail(ErrorCode::kUnavailable, "answers " + answer.substr(9, answer.find('\r') - 9));
  return answer.substr(end + 4);
}

}  // namespace

std::vector<NetworkInterface> network_interfaces() {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return {};
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> list(first, &::freeifaddrs);
  std::vector<NetworkInterface> all;
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    sockaddr_in address{};
    std::memcpy(&address, one->ifa_addr, sizeof address);
    std::array<char, INET_ADDRSTRLEN> text{};
    ::inet_ntop(AF_INET, &address.sin_addr, text.data(), text.size());
    all.push_back({one->ifa_name, text.data(), (one->ifa_flags & IFF_UP) != 0,
                   (one->ifa_flags & IFF_LOOPBACK) != 0, (one->ifa_flags & IFF_MULTICAST) != 0});
  }
  return all;
}

std::optional<std::string> multicast_fault(const NetworkInterface& interface) {
  const Descriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ip_mreqn group{};
  ::inet_pton(AF_INET, kGroup, &group.imr_multiaddr);
  ::inet_pton(AF_INET, interface.address.c_str(), &group.imr_address);
  sockaddr_in any{};
  any.sin_family = AF_INET;
  socklen_t size = sizeof any;
  if (::bind(socket.number(), reinterpret_cast<const sockaddr*>(&any), size) != 0 ||
      ::getsockname(socket.number(), reinterpret_cast<sockaddr*>(&any), &size) != 0)
    return "no socket: " + system_text();
  if (::setsockopt(socket.number(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) != 0)
    return "cannot join a group: " + system_text();
  if (::setsockopt(socket.number(), IPPROTO_IP, IP_MULTICAST_IF, &group, sizeof group) != 0)
    return "cannot send to a group: " + system_text();
  sockaddr_in to = any;
  to.sin_addr = group.imr_multiaddr;
  const char hello = 'f';
  if (::sendto(socket.number(), &hello, 1, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to) !=
      1)
    return "cannot send to a group: " + system_text() +
           " (is there a route? `ip route add 224.0.0.0/4 dev " + interface.name + "`)";
  pollfd wait{socket.number(), POLLIN, 0};
  if (::poll(&wait, 1, kMulticastTimeout_ms) != 1)
    return "does not come back: a firewall may drop it (udp to 224.0.0.0/4)";
  return std::nullopt;
}

std::optional<ListeningPort> listening_port_of(const std::string& line, Transport transport) {
  constexpr const char* kTcpListens = "0A";
  constexpr const char* kUdpOpen = "07";
  std::istringstream words(line);
  std::string slot;
  std::string local;
  std::string remote;
  std::string state;
  if (!(words >> slot >> local >> remote >> state)) return std::nullopt;
  if (state != (transport == Transport::kTcp ? kTcpListens : kUdpOpen)) return std::nullopt;
  const auto endpoint = endpoint_of(local);
  if (!endpoint) return std::nullopt;
  ListeningPort port{transport, endpoint->first, endpoint->second};
  for (int skipped = 0; skipped < 5; ++skipped) words >> slot;  // queues, timers, user
  words >> port.inode;
  return port;
}

std::vector<ListeningPort> listening_ports() {
  std::vector<ListeningPort> all;
  for (const auto& [name, transport] :
       {std::pair("tcp", Transport::kTcp), std::pair("tcp6", Transport::kTcp),
        std::pair("udp", Transport::kUdp), std::pair("udp6", Transport::kUdp)}) {
    std::ifstream file(std::string("/proc/net/") + name);
    for (std::string line; std::getline(file, line);)
      if (auto port = listening_port_of(line, transport)) all.push_back(*port);
  }
  const auto owners = socket_owners();
  for (ListeningPort& port : all) {
    const auto owner = owners.find(port.inode);
    if (owner != owners.end()) port.owner = owner->second;
  }
  return all;
}

Expected<std::string> http_get(const std::string& host, std::uint16_t port, const std::string& path,
                               std::chrono::milliseconds timeout) {
  const std::string where = host + ":" + std::to_string(port);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* first = nullptr;
  if (::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &first) != 0)
    return fail(ErrorCode::kNotFound, "no such host", where);
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> list(first, &::freeaddrinfo);
  for (const addrinfo* one = first; one != nullptr; one = one->ai_next) {
    const Descriptor connection(::socket(one->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (!connect_to(connection, *one, timeout)) continue;
    auto answer = ask(connection.number(), "GET " + path + " HTTP/1.1\r\nHost: " + where +
                                               "\r\nConnection: close\r\n\r\n");
    auto body = answer ? body_of(*answer) : std::move(answer);
    if (!body) return fail(body.error().code, body.error().what, where);
    return body;
  }
  return fail(ErrorCode::kUnavailable, "no reply", where);
}

}  // namespace fiducap
