#include "tools/doctor/http_get.hpp"

#include <netdb.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

namespace fiducap {

namespace {

constexpr std::size_t kMost_bytes = 4u << 20;

class Connection final {
 public:
  explicit Connection(int fd) : fd_(fd) {}
  ~Connection() {
    if (fd_ >= 0) ::close(fd_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  [[nodiscard]] int fd() const { return fd_; }

 private:
  int fd_;
};

bool connect_to(const Connection& connection, const addrinfo& address,
                std::chrono::milliseconds patience) {
  const timeval wait{patience.count() / 1000, (patience.count() % 1000) * 1000};
  return connection.fd() >= 0 &&
         ::setsockopt(connection.fd(), SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait) == 0 &&
         ::setsockopt(connection.fd(), SOL_SOCKET, SO_SNDTIMEO, &wait, sizeof wait) == 0 &&
         ::connect(connection.fd(), address.ai_addr, address.ai_addrlen) == 0;
}

Expected<std::string> ask(int fd, const std::string& request) {
  if (::send(fd, request.data(), request.size(), MSG_NOSIGNAL) !=
      static_cast<ssize_t>(request.size()))
    return fail(ErrorCode::kClosed, "does not take the question");
  std::string answer;
  std::array<char, 16384> part{};
  for (;;) {
    const ssize_t n = ::recv(fd, part.data(), part.size(), 0);
    if (n == 0) return answer;
    if (n < 0) return fail(ErrorCode::kUnavailable, std::strerror(errno));
    answer.append(part.data(), static_cast<std::size_t>(n));
    if (answer.size() > kMost_bytes) return fail(ErrorCode::kInvalid, "answers without end");
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

Expected<std::string> http_get(const std::string& host, std::uint16_t port, const std::string& path,
                               std::chrono::milliseconds patience) {
  const std::string where = host + ":" + std::to_string(port);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* first = nullptr;
  if (::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &first) != 0)
    return fail(ErrorCode::kNotFound, "no such host", where);
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> list(first, &::freeaddrinfo);
  for (const addrinfo* one = first; one != nullptr; one = one->ai_next) {
    const Connection connection(::socket(one->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (!connect_to(connection, *one, patience)) continue;
    auto answer = ask(connection.fd(), "GET " + path + " HTTP/1.1\r\nHost: " + where +
                                           "\r\nConnection: close\r\n\r\n");
    auto body = answer ? body_of(*answer) : std::move(answer);
    if (!body) return fail(body.error().code, body.error().what, where);
    return body;
  }
  return fail(ErrorCode::kUnavailable, "nobody answers", where);
}

}  // namespace fiducap
