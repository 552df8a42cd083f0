#include "streaming/vrpn/session.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <boost/asio/write.hpp>
#include <utility>

#include "base/log.hpp"

namespace fiducap::vrpn {

namespace {

using boost::system::error_code;

// About half a second of a busy scene. More would only let a client that wakes up read old poses.
constexpr int kSendBuffer_bytes = 64 * 1024;
// A dead peer (power, cable) is found after 10 + 3 · 5 s.
constexpr int kKeepAliveIdle_s = 10;
constexpr int kKeepAliveInterval_s = 5;
constexpr int kKeepAliveProbes = 3;

void set_option(int socket, int level, int option, int value) {
  ::setsockopt(socket, level, option, &value, sizeof(value));  // a refusal costs latency or patience, nothing else
}

void tune(Session::tcp::socket& socket) {
  const int fd = socket.native_handle();
  set_option(fd, IPPROTO_TCP, TCP_NODELAY, 1);
  set_option(fd, SOL_SOCKET, SO_SNDBUF, kSendBuffer_bytes);
  set_option(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
  set_option(fd, IPPROTO_TCP, TCP_KEEPIDLE, kKeepAliveIdle_s);
  set_option(fd, IPPROTO_TCP, TCP_KEEPINTVL, kKeepAliveInterval_s);
  set_option(fd, IPPROTO_TCP, TCP_KEEPCNT, kKeepAliveProbes);
}

}  // namespace

void SessionContext::say(log::Level level, const std::string& text) {
  if (log_lines_left == 0) {
    ++log_lines_lost;
    return;
  }
  --log_lines_left;
  log::write(level, "vrpn", text);
}

Session::Session(std::shared_ptr<SessionContext> context, tcp::socket socket, tcp::endpoint peer, Origin origin)
    : context_(std::move(context)),
      socket_(std::move(socket)),
      peer_(std::move(peer)),
      origin_(origin),
      connection_(context_->config, context_->senders, origin),
      since_(context_->clock.now()) {}

void Session::start() {
  if (origin_ == Origin::kDirect) return connected();
  socket_.async_connect(peer_, [self = shared_from_this()](const error_code& error) {
    if (self->closed()) return;
    if (error) return self->close("cannot be reached: " + error.message());
    self->connected();
  });
}

void Session::connected() {
  state_ = State::kConnected;
  since_ = context_->clock.now();
  tune(socket_);
  outbox_.greet(connection_.greeting());  // at once: some clients wait for it
  pump();
  if (!closed()) read();
}

void Session::read() {
  socket_.async_read_some(boost::asio::buffer(incoming_),
                          [self = shared_from_this()](const error_code& error, std::size_t n) {
                            if (self->closed()) return;
                            if (error) return self->close("left");
                            self->received(n);
                            if (!self->closed()) self->read();
                          });
}

void Session::received(std::size_t n) {
  const Instant now = context_->clock.now();
  const bool was_open = connection_.open();
  const auto result = connection_.receive(std::span(incoming_).first(n), context_->utc_ns(now), outbox_.reliable());
  for (const auto& note : connection_.take_notes()) context_->say(note.level, peer_text() + " " + note.text);
  if (!result) return close("is refused: " + result.error().text(), log::Level::kWarning);
  if (!was_open && connection_.open()) {
    since_ = now;
    context_->say(log::Level::kInfo, "client " + peer_text() + (origin_ == Origin::kDirect ? " connected" : " connected on its request"));
  }
  if (const auto port = connection_.udp_port(); port && port != udp_port_) open_udp(*port);
  if (auto why = outbox_.overdue(now)) return close(*why, log::Level::kWarning);
  pump();
}

void Session::open_udp(std::uint16_t port) {
  udp_port_ = port;
  udp_.emplace(socket_.get_executor());
  error_code error;
  udp_->open(udp::v4(), error);
  // To the TCP peer's address, whatever address the client named: nobody can aim reports at a third party.
  if (!error) udp_->connect({peer_.address(), port}, error);
  if (!error) udp_->non_blocking(true, error);
  if (!error) return;
  context_->say(log::Level::kWarning,
                peer_text() + " gets its reports by TCP, no UDP to port " + std::to_string(port) + ": " + error.message());
  udp_.reset();
}

void Session::publish(const std::shared_ptr<const EncodedFrame>& frame, std::span<std::byte> numbered) {
  if (!open()) return;
  ++frames_offered_;
  if (udp_) return send_udp(*frame, numbered);
  if (!outbox_.offer(frame)) ++frames_dropped_;
  pump();
}

void Session::send_udp(const EncodedFrame& frame, std::span<std::byte> numbered) {
  number_messages(numbered, udp_sequence_);
  bool all_sent = true;
  std::size_t begin = 0;
  for (const std::size_t end : frame.datagram_ends) {
    error_code error;
    udp_->send(boost::asio::buffer(numbered.data() + begin, end - begin), 0, error);
    all_sent = all_sent && !error;  // full buffer or receiver gone; TCP says when the client is
    begin = end;
  }
  if (!all_sent) ++frames_dropped_;
}

void Session::describe_new_senders() {
  if (!open()) return;
  connection_.describe_new_senders(context_->utc_ns(context_->clock.now()), outbox_.reliable());
  pump();
}

void Session::send_reliable(std::span<const std::byte> messages) {
  if (!open()) return;
  auto& out = outbox_.reliable();
  out.insert(out.end(), messages.begin(), messages.end());
  pump();
}

void Session::pump() {
  if (!outbox_.take(context_->clock.now(), writing_)) return;
  boost::asio::async_write(socket_, boost::asio::buffer(writing_),
                           [self = shared_from_this()](const error_code& error, std::size_t) {
                             if (self->closed()) return;
                             if (error) return self->close("left: " + error.message());
                             self->outbox_.written(self->context_->clock.now());
                             self->pump();
                           });
}

void Session::tick(Instant now) {
  if (closed()) return;
  if (connecting() && now - since_ > kConnectTime) return close("cannot be reached within 3 s", log::Level::kInfo);
  if (state_ == State::kConnected && !open() && now - since_ > kCookieTime) {
    return close("is closed: sent no VRPN cookie within 5 s", log::Level::kInfo);
  }
  if (auto why = outbox_.overdue(now)) close(*why, log::Level::kWarning);
}

void Session::close(std::string_view why, log::Level level) {
  if (closed()) return;
  context_->say(open() ? std::max(level, log::Level::kInfo) : level, "client " + peer_text() + " " + std::string(why));
  state_ = State::kClosed;
  error_code ignored;
  socket_.close(ignored);
  udp_.reset();
}

ClientStatus Session::status(Instant now) const {
  const auto& config = context_->config;
  std::string detail = std::string(name_of(config.up)) + " m";
  detail += config.velocity ? ", velocity on" : ", velocity off";
  detail += config.acceleration ? ", acceleration on" : ", acceleration off";
  return {"vrpn", peer_text(), detail, frames_offered_ - frames_dropped_, frames_dropped_, to_seconds(now - since_)};
}

std::string Session::peer_text() const {
  return peer_.address().to_string() + ":" + std::to_string(peer_.port()) + (udp_ ? " udp" : " tcp");
}

}  // namespace fiducap::vrpn
