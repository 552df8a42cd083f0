#include <array>
#include <cerrno>
#include <cstring>
#include <memory>

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

Expected<std::string> http_get(const std::string& host, std::uint16_t port, const std::string& path,
                               std::chrono::milliseconds timeout, const std::string& token) {
  const std::string authorization = token.empty() ? "" : "Authorization: Bearer " + token + "\r\n";
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
    auto answer = ask(connection.number(), "GET " + path + " HTTP/1.1\r\nHost: " + where + "\r\n" +
                                               authorization + "Connection: close\r\n\r\n");
    auto body = answer ? body_of(*answer) : std::move(answer);
    if (!body) return fail(body.error().code, body.error().what, where);
    return body;
  }
  return fail(ErrorCode::kUnavailable, "no reply", where);
}

}  // namespace fiducap
