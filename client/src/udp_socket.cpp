#include "src/udp_socket.hpp"

#include <netinet/in.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "src/drop_count.hpp"

namespace fiducap::sdk {

namespace {

// Some frames of a large scene while the thread is busy; limited by net.core.rmem_max.
constexpr int kReceiveBuffer = 4 << 20;

std::string text_of_errno() { return std::generic_category().message(errno); }

// The source address equals the address of the server only when both are on this machine.
bool is_same_address(const sockaddr_storage& a, const sockaddr_storage& b) {
  if (a.ss_family != b.ss_family) return false;
  if (a.ss_family == AF_INET) {
    return reinterpret_cast<const sockaddr_in&>(a).sin_addr.s_addr ==
           reinterpret_cast<const sockaddr_in&>(b).sin_addr.s_addr;
  }
  return std::memcmp(&reinterpret_cast<const sockaddr_in6&>(a).sin6_addr,
                     &reinterpret_cast<const sockaddr_in6&>(b).sin6_addr, sizeof(in6_addr)) == 0;
}

UdpSocket::Result result_of_errno() {
  return errno == ECONNREFUSED ? UdpSocket::Result::kRefused : UdpSocket::Result::kNothing;
}

}  // namespace

std::string UdpSocket::open(const Address& server) {
  close();
  fd_ = ::socket(server.bytes.ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) return "no socket: " + text_of_errno();
  // A smaller buffer only means earlier losses: errors are ignored.
  ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof(kReceiveBuffer));
  count_drops(fd_);
  dropped_ = 0;
  if (::connect(fd_, reinterpret_cast<const sockaddr*>(&server.bytes), server.size) != 0) {
    const std::string why = "no route to the server: " + text_of_errno();
    close();
    return why;
  }
  sockaddr_storage own{};
  socklen_t size = sizeof(own);
  server_is_local_ = ::getsockname(fd_, reinterpret_cast<sockaddr*>(&own), &size) == 0 &&
                     is_same_address(own, server.bytes);
  return {};
}

void UdpSocket::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

UdpSocket::Result UdpSocket::send(const std::uint8_t* bytes, std::size_t size) {
  const auto sent = ::send(fd_, bytes, size, MSG_NOSIGNAL);
  return sent >= 0 ? Result::kDone : result_of_errno();
}

UdpSocket::Result UdpSocket::receive(std::uint8_t* bytes, std::size_t& size) {
  const auto received = receive_counting_drops(fd_, bytes, size, nullptr, dropped_);
  if (received < 0) return result_of_errno();
  size = static_cast<std::size_t>(received);
  return Result::kDone;
}

}  // namespace fiducap::sdk
