#include "streaming/vrpn/session.hpp"

#include <utility>

#include "base/log.hpp"
#include "streaming/vrpn/codec.hpp"

namespace fiducap::vrpn {

void SessionContext::say(log::Level level, const std::string& text) {
  if (log_lines_left == 0) {
    ++log_lines_lost;
    return;
  }
  --log_lines_left;
  log::write(level, "vrpn", text);
}

Session::Session(std::shared_ptr<SessionContext> context, net::Socket socket, Origin origin)
    : TcpSession(std::move(socket), "vrpn", context->clock),
      context_(std::move(context)),
      origin_(origin),
      connection_(context_->config, context_->senders, origin) {}

void Session::start() {
  replies() = connection_.greeting();
  TcpSession::start();
}

void Session::received(std::span<const std::byte> bytes) {
  const bool was_open = connection_.open();
  const std::size_t before = replies().size();
  const Instant now = clock().now();
  const auto result = connection_.receive(bytes, context_->utc_ns(now), replies());
  for (const auto& note : connection_.take_notes()) {
    context_->say(note.level, transport_text() + " " + note.text);
  }
  if (!result) return close("is refused: " + result.error().text(), log::Level::kWarning);
  number_messages(std::span(replies()).subspan(before), context_->sequence);
  if (!was_open && connection_.open()) {
    open_since_ = now;
    context_->say(log::Level::kInfo,
                  "client " + transport_text() +
                      (origin_ == Origin::kDirect ? " connected" : " connected on its request"));
  }
  flush();
}

void Session::describe_new_senders() {
  if (!open()) return;
  const std::size_t before = replies().size();
  connection_.describe_new_senders(context_->utc_ns(clock().now()), replies());
  number_messages(std::span(replies()).subspan(before), context_->sequence);
  flush();
}

void Session::ticked(Instant now) {
  if (!open() && now - since() > kCookieTime) close("is closed: sent no VRPN cookie within 5 s");
}

ClientStatus Session::status(Instant now) const {
  const auto& config = context_->config;
  std::string detail = std::string(name_of(config.up)) + " m";
  detail += config.velocity ? ", velocity on" : ", velocity off";
  detail += config.acceleration ? ", acceleration on" : ", acceleration off";
  ClientStatus status;
  status.protocol = "vrpn";
  status.peer = transport_text();
  status.detail = detail;
  status.frames_sent = frames_sent() + datagrams.frames_sent();
  status.frames_dropped = frames_dropped() + datagrams.frames_dropped();
  status.connected_s = to_seconds(now - open_since_.value_or(since()));
  return status;
}

std::string Session::transport_text() const {
  return net::text_of(peer()) + (udp_port() ? " udp" : " tcp");
}

}  // namespace fiducap::vrpn
