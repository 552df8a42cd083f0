#include "strict_client.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <span>

namespace fiducap::vicon {

StrictClient::~StrictClient() {
  if (socket_ >= 0) ::close(socket_);
}

void StrictClient::connect(std::uint16_t port) {
  socket_ = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in server{};
  server.sin_family = AF_INET;
  server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  server.sin_port = htons(port);
  ASSERT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&server), sizeof(server)), 0);
  ::fcntl(socket_, F_SETFL, ::fcntl(socket_, F_GETFL) | O_NONBLOCK);
}

void StrictClient::pump() {
  if (!reading_ || closed_) return;
  std::byte buffer[65536];
  for (;;) {
    const ssize_t n = ::recv(socket_, buffer, sizeof(buffer), 0);
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) closed_ = true;
    if (n <= 0) break;
    in_.insert(in_.end(), buffer, buffer + n);
  }
  const std::size_t used = view.take(in_);
  in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(used));
}

void StrictClient::want(const std::set<std::uint32_t>& types) {
  view.requested = types;
  send(client::types(types));
}

void StrictClient::send(const client::Bytes& bytes) {
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t n = ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) return;  // closed, or the server does not read: the tests look at what comes back
    sent += static_cast<std::size_t>(n);
  }
}

}  // namespace fiducap::vicon
