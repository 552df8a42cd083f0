#include "streaming/net/tcp_session.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <boost/asio/write.hpp>
#include <utility>

#include "streaming/net/bind.hpp"

namespace fiducap::net {

namespace {

namespace asio = boost::asio;
using boost::system::error_code;

// About half a second of a busy scene. More would only let a client that wakes up read old poses.
constexpr int kSendBuffer_bytes = 64 * 1024;
// A dead peer (power, cable) is found after 10 + 3 · 5 s.
constexpr int kKeepAliveIdle_s = 10;
constexpr int kKeepAliveInterval_s = 5;
constexpr int kKeepAliveProbes = 3;

void set_option(int socket, int level, int option, int value) {
  ::setsockopt(socket, level, option, &value,
               sizeof(value));  // a refusal costs latency or patience, nothing else
}

}  // namespace

void tune(asio::ip::tcp::socket& socket) {
  const int fd = socket.native_handle();
  set_option(fd, IPPROTO_TCP, TCP_NODELAY, 1);
  set_option(fd, SOL_SOCKET, SO_SNDBUF, kSendBuffer_bytes);
  set_option(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
  set_option(fd, IPPROTO_TCP, TCP_KEEPIDLE, kKeepAliveIdle_s);
  set_option(fd, IPPROTO_TCP, TCP_KEEPINTVL, kKeepAliveInterval_s);
  set_option(fd, IPPROTO_TCP, TCP_KEEPCNT, kKeepAliveProbes);
}

TcpSession::TcpSession(tcp::socket socket, std::string_view protocol, const Clock& clock)
    : socket_(std::move(socket)), protocol_(protocol), clock_(clock), since_(clock.now()) {
  error_code gone;
  endpoint_ = socket_.remote_endpoint(gone);  // one that left already: the first read says so
  peer_text_ = peer_text(endpoint_);
}

void TcpSession::start() {
  tune(socket_);
  error_code ignored;
  socket_.non_blocking(true, ignored);
  flush();
  if (!closed_) read();
}

void TcpSession::read() {
  socket_.async_read_some(asio::buffer(incoming_),
                          [self = shared_from_this()](const error_code& error, std::size_t n) {
                            if (self->closed_) return;
                            if (error) return self->close("left");
                            self->received(std::span<const std::byte>(self->incoming_).first(n));
                            if (self->closed_) return;
                            if (const auto why = self->outbox_.overdue(self->clock_.now()))
                              return self->close(*why, log::Level::kWarning);
                            self->flush();
                            if (!self->closed_) self->read();
                          });
}

void TcpSession::send(std::span<const std::byte> bytes) {
  if (closed_) return;
  outbox_.reply(bytes);
  flush();
}

void TcpSession::offer(SharedBytes frame) {
  if (closed_) return;
  ++offered_;
  if (!outbox_.offer(std::move(frame))) ++dropped_;
  flush();
}

// Written at once: nearly always it fits into the socket's buffer, and then no operation is queued,
// nothing allocated and nobody woken. What does not fit is written when there is room.
void TcpSession::flush() {
  while (!closed_) {
    const auto pieces = outbox_.take(clock_.now());
    if (!pieces) return;
    std::array<asio::const_buffer, 2> buffers{
        asio::const_buffer((*pieces)[0].data(), (*pieces)[0].size()),
        asio::const_buffer((*pieces)[1].data(), (*pieces)[1].size())};
    error_code error;
    std::size_t done = socket_.write_some(buffers, error);
    if (error && error != asio::error::would_block && error != asio::error::try_again) {
      return close("left: " + error.message());
    }
    for (auto& buffer : buffers) {
      const std::size_t part = std::min(done, buffer.size());
      buffer += part;
      done -= part;
    }
    if (buffers[0].size() + buffers[1].size() > 0) return write_rest(buffers);
    outbox_.written(clock_.now());
  }
}

void TcpSession::write_rest(const std::array<asio::const_buffer, 2>& buffers) {
  asio::async_write(socket_, buffers,
                    [self = shared_from_this()](const error_code& error, std::size_t) {
                      if (self->closed_) return;
                      if (error) return self->close("left: " + error.message());
                      self->outbox_.written(self->clock_.now());
                      self->flush();
                    });
}

void TcpSession::tick(Instant now) {
  if (closed_) return;
  if (const auto why = outbox_.overdue(now)) return close(*why, log::Level::kWarning);
  ticked(now);
}

void TcpSession::close(std::string_view why, log::Level level) {
  if (closed_) return;
  closed_ = true;
  log::write(level, protocol_, "client " + peer_text_ + " " + std::string(why));
  error_code ignored;
  socket_.close(ignored);
}

}  // namespace fiducap::net
