#include "streaming/net/tcp_session.hpp"

#include <netinet/tcp.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <utility>

#include "streaming/net/bind.hpp"
#include "streaming/net/guard.hpp"
#include "streaming/net/standing_wait.hpp"

namespace fiducap::net {

namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
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

/// Low latency, a send buffer that holds no stale seconds, and dead peers found within half a
/// minute.
void tune(tcp::socket& socket) {
  const int fd = socket.native_handle();
  set_option(fd, IPPROTO_TCP, TCP_NODELAY, 1);
  set_option(fd, SOL_SOCKET, SO_SNDBUF, kSendBuffer_bytes);
  set_option(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
  set_option(fd, IPPROTO_TCP, TCP_KEEPIDLE, kKeepAliveIdle_s);
  set_option(fd, IPPROTO_TCP, TCP_KEEPINTVL, kKeepAliveInterval_s);
  set_option(fd, IPPROTO_TCP, TCP_KEEPCNT, kKeepAliveProbes);
}

Peer remote_peer(const tcp::socket& socket) {
  error_code gone;  // one that left already: the first read says so
  return peer_of(socket.remote_endpoint(gone));
}

}  // namespace

void DeleteSocket::operator()(TcpSocket* socket) const { delete socket; }

struct TcpSession::Link {
  explicit Link(tcp::socket opened) : socket(std::move(opened)), timer(socket.get_executor()) {}

  tcp::socket socket;
  asio::steady_timer timer;
  PendingWait reading;
  std::array<std::byte, 16384> incoming{};
};

TcpSession::TcpSession(Socket socket, std::string_view protocol, const Clock& clock)
    : Session(remote_peer(socket->asio)),
      protocol_(protocol),
      clock_(clock),
      since_(clock.now()),
      link_(std::make_unique<Link>(std::move(socket->asio))) {}

TcpSession::~TcpSession() = default;

template <typename Work>
void TcpSession::guard(Work&& work) {
  const auto whose = [this] { return "client " + peer_text() + " is left"; };
  if (!guarded(protocol_, whose, std::forward<Work>(work))) {
    close("is closed after a failure", log::Level::kWarning);
  }
}

void TcpSession::start() {
  tune(link_->socket);
  error_code ignored;
  link_->socket.non_blocking(true, ignored);
  flush();
  if (!closed()) read();
}

void TcpSession::read() {
  link_->socket.async_read_some(asio::buffer(link_->incoming),
                                [self = self(), token = link_->reading.begin()](
                                    const error_code& error, std::size_t size) mutable {
                                  token.release();
                                  if (self->closed()) return;
                                  if (error) return self->close("left");
                                  self->guard([&] { self->take(size); });
                                });
}

void TcpSession::take(std::size_t size) {
  received(std::span<const std::byte>(link_->incoming).first(size));
  if (closed()) return;
  if (const auto why = outbox_.overdue(clock_.now())) return close(*why, log::Level::kWarning);
  flush();
  if (!closed()) read();
}

void TcpSession::send(std::span<const std::byte> bytes) {
  if (closed()) return;
  outbox_.reply(bytes);
  flush();
}

void TcpSession::offer(SharedBytes frame) {
  if (closed()) return;
  ++offered_;
  if (!outbox_.offer(std::move(frame))) ++dropped_;
  flush();
}

// Written at once: nearly always it fits into the socket's buffer, and then no operation is queued,
// nothing allocated and nobody woken. What does not fit is written when there is room.
void TcpSession::flush() {
  while (!closed()) {
    const auto pieces = outbox_.take(clock_.now());
    if (!pieces) return;
    auto [first, second] = *pieces;
    const std::array<asio::const_buffer, 2> buffers{asio::buffer(first.data(), first.size()),
                                                    asio::buffer(second.data(), second.size())};
    error_code error;
    const std::size_t done = link_->socket.write_some(buffers, error);
    if (error && error != asio::error::would_block && error != asio::error::try_again) {
      return close("left: " + error.message());
    }
    second = second.subspan(done - std::min(done, first.size()));
    first = first.subspan(std::min(done, first.size()));
    if (first.size() + second.size() > 0) return write_rest(first, second);
    outbox_.written(clock_.now());
  }
}

void TcpSession::write_rest(std::span<const std::byte> first, std::span<const std::byte> second) {
  const std::array<asio::const_buffer, 2> buffers{asio::buffer(first.data(), first.size()),
                                                  asio::buffer(second.data(), second.size())};
  asio::async_write(link_->socket, buffers, [self = self()](const error_code& error, std::size_t) {
    if (self->closed()) return;
    if (error) return self->close("left: " + error.message());
    self->guard([&] {
      self->outbox_.written(self->clock_.now());
      self->flush();
    });
  });
}

void TcpSession::wake_after(Duration wait) {
  link_->timer.expires_after(wait);
  link_->timer.async_wait([self = self()](const error_code& cancelled) {
    if (!cancelled && !self->closed()) self->guard([&] { self->woken(); });
  });
}

void TcpSession::tick(Instant now) {
  if (closed()) return;
  if (!link_->reading) return close("is closed after a failure", log::Level::kWarning);
  if (const auto why = outbox_.overdue(now)) return close(*why, log::Level::kWarning);
  ticked(now);
}

void TcpSession::close(std::string_view why, log::Level level) {
  if (!close_once()) return;
  log::write(level, protocol_, "client " + peer_text() + " " + std::string(why));
  error_code ignored;
  link_->timer.cancel(ignored);
  link_->socket.close(ignored);
  ended();
}

}  // namespace fiducap::net
