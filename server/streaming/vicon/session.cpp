#include "streaming/vicon/session.hpp"

#include <utility>

namespace fiducap::vicon {

Session::Session(net::Socket socket, std::shared_ptr<SessionContext> context)
    : TcpSession(std::move(socket), "vicon", context->clock),
      context_(std::move(context)),
      connection_(context_->profiles, context_->clock.now()) {}

void Session::start() {
  TcpSession::start();
  if (!closed()) wake_after(kGreetingDelay);
}

void Session::woken() {
  send(connection_.greeting());
  publish();  // it may have asked already
}

void Session::received(std::span<const std::byte> bytes) {
  const bool was_open = open();
  const auto result = connection_.receive(bytes, clock().now(), replies());
  if (!result) return close("is refused: " + result.error().text(), log::Level::kWarning);
  if (!was_open && open()) log::info("vicon", "client " + peer_text() + " connected");
  publish();
}

void Session::publish() {
  FrameBoard& board = context_->board;
  if (closed() || board.empty() || !connection_.wants(board.id())) return;
  // A frame that still waits is dropped for this one; its static objects must not get lost with it.
  const bool statics = connection_.wants_statics(board.statics_version()) ||
                       (statics_in_last_frame_ && frame_waits());
  offer(board.packet(connection_.profile(), statics, clock().now()));
  statics_in_last_frame_ = statics;
  connection_.sent(board.id(), statics ? std::optional(board.statics_version()) : std::nullopt);
}

void Session::ticked(Instant now) {
  if (const auto why = connection_.overdue(now)) close(*why);
}

ClientStatus Session::status(Instant now) const {
  return {"vicon",       peer_text(),      "z-up mm, " + connection_.summary(),
          frames_sent(), frames_dropped(), to_seconds(now - since())};
}

}  // namespace fiducap::vicon
