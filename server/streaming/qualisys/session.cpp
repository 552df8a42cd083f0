#include "streaming/qualisys/session.hpp"

#include <utility>

namespace fiducap::qualisys {

namespace {

// Every client sends its version at once; who says nothing holds a place that others want.
constexpr Duration kSilence = std::chrono::seconds(10);

}  // namespace

Session::Session(net::Socket socket, std::shared_ptr<SharedState> shared, Dialect dialect,
                 std::uint64_t id, const Clock& clock)
    : TcpSession(std::move(socket), "qualisys", clock),
      shared_(std::move(shared)),
      connection_(*shared_, dialect, id, net::address_text(peer()), peer().port) {}

void Session::start() {
  connection_.greet(replies());
  TcpSession::start();
}

void Session::tell(Event event) {
  connection_.tell(event, replies());
  flush();
}

void Session::received(std::span<const std::byte> bytes) {
  const auto result = connection_.receive(bytes, replies());
  if (!result) return close("is refused: " + result.error().text(), log::Level::kWarning);
  answer_current();
  flush();
}

void Session::answer_current() {
  const auto profile = connection_.current_of(shared_->frames.number());
  if (profile) send(shared_->frames.encoded(*profile)->packet);
}

void Session::ticked(Instant now) {
  if (!connection_.spoke() && now - since() > kSilence) {
    close("is closed: said nothing within 10 s");
  }
}

ClientStatus Session::status(Instant now) const {
  ClientStatus status;
  status.protocol = "qualisys";
  status.peer = peer_text() + (connection_.udp_port() ? " + udp" : "");
  status.detail = connection_.detail();
  status.frames_sent = frames_sent() + datagrams.frames_sent();
  status.frames_dropped = frames_dropped() + datagrams.frames_dropped();
  status.connected_s = to_seconds(now - since());
  return status;
}

}  // namespace fiducap::qualisys
