#include "src/group_socket.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <unistd.h>

#include <cstring>

#include "src/drop_count.hpp"

namespace fiducap::sdk {

namespace {

constexpr int kReceiveBuffer = 4 << 20;  // as of UdpSocket
constexpr int kStrangersPerCall = 64;

}  // namespace

bool GroupSocket::open(const std::array<std::uint8_t, 4>& group, std::uint16_t port,
                       const UdpSocket& towards_server) {
  close();
  sockaddr_in own{};
  sockaddr_in server{};
  socklen_t own_size = sizeof(own);
  socklen_t server_size = sizeof(server);
  const int towards = towards_server.descriptor();
  if (::getsockname(towards, reinterpret_cast<sockaddr*>(&own), &own_size) != 0 ||
      own.sin_family != AF_INET ||
      ::getpeername(towards, reinterpret_cast<sockaddr*>(&server), &server_size) != 0) {
    return false;
  }
  fd_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) return false;
  const int on = 1;  // every client of this machine listens at the same port
  ::setsockopt(fd_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof(kReceiveBuffer));
  count_drops(fd_);
  sockaddr_in local{};
  local.sin_family = AF_INET;
  local.sin_port = htons(port);
  std::memcpy(&local.sin_addr, group.data(),
              group.size());  // bound to the group: nothing else arrives
  ip_mreq membership{};
  membership.imr_multiaddr = local.sin_addr;
  membership.imr_interface = own.sin_addr;
  if (::bind(fd_, reinterpret_cast<const sockaddr*>(&local), sizeof(local)) != 0 ||
      ::setsockopt(fd_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof(membership)) != 0) {
    close();
    return false;
  }
  group_ = group;
  port_ = port;
  server_ = server.sin_addr.s_addr;
  dropped_ = 0;
  return true;
}

void GroupSocket::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

bool GroupSocket::receive(std::uint8_t* bytes, std::size_t& size) {
  for (int i = 0; i < kStrangersPerCall; ++i) {
    sockaddr_storage from{};
    const auto received = receive_counting_drops(fd_, bytes, size, &from, dropped_);
    if (received < 0) return false;
    if (from.ss_family != AF_INET ||
        reinterpret_cast<const sockaddr_in&>(from).sin_addr.s_addr != server_)
      continue;
    size = static_cast<std::size_t>(received);
    return true;
  }
  return false;
}

}  // namespace fiducap::sdk
