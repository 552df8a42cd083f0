#include "streaming/net/tcp_session.hpp"

#include <netinet/tcp.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>

#include "streaming/net/bind.hpp"
#include "streaming/net/repeated_wait.hpp"

namespace fiducap::net {

namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

// About half a second of a busy scene; a larger buffer would hold old poses.
constexpr int kSendBuffer_bytes = 64 * 1024;
// A dead peer (power, cable) is found after 10 + 3 · 5 s.
constexpr int kKeepAliveIdle_s = 10;
constexpr int kKeepAliveInterval_s = 5;
constexpr int kKeepAliveProbes = 3;

void set_option(int socket, int level, int option, int value) {
  ::setsockopt(socket, level, option, &value, sizeof(value));  // optional: a failure is harmless
}

/// Low latency, a small send buffer, and dead peers found within half a minute.
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
  error_code gone;  // closed already: the first read fails
  return peer_of(socket.remote_endpoint(gone));
}

}  // namespace

bool TcpOutbox::offer(SharedBytes frame) {
  const bool nothing_lost = frame_ == nullptr;
  frame_ = std::move(frame);
  return nothing_lost;
}

std::optional<TcpOutbox::Pieces> TcpOutbox::take(Instant now) {
  note_waiting(now);
  if (writing_ || (replies_.empty() && frame_ == nullptr)) return std::nullopt;
  writing_ = true;
  in_flight_since_ = std::exchange(waiting_since_, std::nullopt).value_or(now);
  replies_in_flight_.swap(replies_);
  replies_.clear();
  frame_in_flight_ = std::exchange(frame_, nullptr);
  Pieces pieces{};
  pieces[0] = replies_in_flight_;
  if (frame_in_flight_) pieces[1] = *frame_in_flight_;
  return pieces;
}

void TcpOutbox::written(Instant now) {
  writing_ = false;
  in_flight_since_.reset();
  replies_in_flight_.clear();
  frame_in_flight_.reset();
  note_waiting(now);
}

std::optional<std::string> TcpOutbox::overdue(Instant now) {
  note_waiting(now);
  const std::size_t bytes = replies_in_flight_.size() + replies_.size();
  if (bytes > kMaxReplyBytes)
    return "does not read: " + std::to_string(bytes) + " bytes of replies are waiting";
  const auto oldest = in_flight_since_ ? in_flight_since_ : waiting_since_;
  if (oldest && now - *oldest > kMaxWait)
    return "does not read: a message is waiting for more than 5 s";
  return std::nullopt;
}

void TcpOutbox::note_waiting(Instant now) {
  if (!waiting_since_ && !replies_.empty()) waiting_since_ = now;
}

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
  const auto whose = [this] { return "client " + peer_text() + " is closed"; };
  if (!log::guarded(protocol_, whose, std::forward<Work>(work)))
    close("is closed after a failure", log::Level::kWarning);
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

// Writes synchronously: nearly always all fits into the socket's buffer, so no operation is queued
// and nothing allocated. The rest is written asynchronously.
void TcpSession::flush() {
  while (!closed()) {
    const auto pieces = outbox_.take(clock_.now());
    if (!pieces) return;
    auto [first, second] = *pieces;
    const std::array<asio::const_buffer, 2> buffers{asio::buffer(first.data(), first.size()),
                                                    asio::buffer(second.data(), second.size())};
    error_code error;
    const std::size_t done = link_->socket.write_some(buffers, error);
    if (error && error != asio::error::would_block && error != asio::error::try_again)
      return close("left: " + error.message());
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
