#include "src/tcp_stream.hpp"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

namespace fiducap::sdk {

namespace {

std::string text_of(int error) { return std::generic_category().message(error); }

/// @return false when the deadline came first
bool wait_for(int fd, short events, TcpStream::Deadline deadline) {
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    pollfd wanted{fd, events, 0};
    const int ready = ::poll(&wanted, 1, std::max(0, static_cast<int>(left.count())));
    if (ready > 0) return true;
    if (ready == 0 || errno != EINTR) return false;
  }
}

/// @return 0 or errno
int connect_by(int fd, const addrinfo& address, TcpStream::Deadline deadline) {
  if (::connect(fd, address.ai_addr, address.ai_addrlen) == 0) return 0;
  if (errno != EINPROGRESS) return errno;
  if (!wait_for(fd, POLLOUT, deadline)) return ETIMEDOUT;
  int error = 0;
  socklen_t size = sizeof(error);
  return ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) == 0 ? error : errno;
}

}  // namespace

std::string TcpStream::open(const std::string& host, std::uint16_t port, Deadline deadline) {
  close();
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_NUMERICSERV | AI_ADDRCONFIG;
  addrinfo* found = nullptr;
  const int code = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (code != 0) return "host name " + host + " not found: " + ::gai_strerror(code);
  int error = EADDRNOTAVAIL;
  for (const addrinfo* it = found; it != nullptr && fd_ < 0; it = it->ai_next) {
    const int fd = ::socket(it->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    error = fd < 0 ? errno : connect_by(fd, *it, deadline);
    if (error == 0) {
      fd_ = fd;
    } else if (fd >= 0) {
      ::close(fd);
    }
  }
  ::freeaddrinfo(found);
  if (fd_ < 0) return "no connection: " + text_of(error);
  const int on = 1;  // commands are small and wait for replies
  ::setsockopt(fd_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  return {};
}

void TcpStream::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

void TcpStream::close_if_gone() {
  if (is_open() && wait_for(fd_, POLLIN, std::chrono::steady_clock::now())) close();
}

bool TcpStream::wait_for_more(Deadline deadline) const { return wait_for(fd_, POLLIN, deadline); }

std::string TcpStream::write(const void* bytes, std::size_t size, Deadline deadline) {
  const auto* at = static_cast<const char*>(bytes);
  while (size > 0) {
    const auto sent = ::send(fd_, at, size, MSG_NOSIGNAL);
    if (sent > 0) {
      at += sent;
      size -= static_cast<std::size_t>(sent);
    } else if (errno == EAGAIN || errno == EINTR) {
      if (!wait_for(fd_, POLLOUT, deadline)) return fail("no reply in time");
    } else {
      return fail("the connection failed: " + text_of(errno));
    }
  }
  return {};
}

std::string TcpStream::read(void* bytes, std::size_t size, Deadline deadline) {
  auto* at = static_cast<char*>(bytes);
  while (size > 0) {
    const auto received = ::recv(fd_, at, size, 0);
    if (received > 0) {
      at += received;
      size -= static_cast<std::size_t>(received);
    } else if (received == 0) {
      return fail("the server closed the connection");
    } else if (errno == EAGAIN || errno == EINTR) {
      if (!wait_for(fd_, POLLIN, deadline)) return fail("no reply in time");
    } else {
      return fail("the connection failed: " + text_of(errno));
    }
  }
  return {};
}

std::string TcpStream::fail(const std::string& why) {
  close();
  return why;
}

}  // namespace fiducap::sdk
