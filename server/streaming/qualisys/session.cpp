#include "streaming/qualisys/session.hpp"

#include <arpa/inet.h>

#include <utility>

namespace fiducap::qualisys {

namespace {

// Every client sends its version at once; who says nothing holds a place that others want.
constexpr Duration kSilence = std::chrono::seconds(10);

}  // namespace

Session::Session(tcp::socket socket, std::shared_ptr<Room> room, Door door, std::uint64_t id,
                 const Clock& clock)
    : TcpSession(std::move(socket), "qualisys", clock),
      room_(std::move(room)),
      connection_(*room_, door, id, endpoint().address().to_string(), endpoint().port()) {}

void Session::greet() {
  connection_.greet(replies());
  start();
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
  const auto profile = connection_.current_of(room_->frames.number());
  if (profile) send(room_->frames.encoded(*profile)->packet);
}

void Session::ticked(Instant now) {
  if (!connection_.spoke() && now - since() > kSilence) {
    close("is closed: said nothing within 10 s");
  }
}

const sockaddr_in& Session::udp_target() {
  return datagrams.aim(endpoint(), connection_.udp_port().value_or(0));
}

ClientStatus Session::status(Instant now) const {
  ClientStatus status;
  status.protocol = "qualisys";
  status.peer = peer() + (connection_.udp_port() ? " + udp" : "");
  status.detail = connection_.detail();
  status.frames_sent = frames_sent() + datagrams.frames_sent();
  status.frames_dropped = frames_dropped() + datagrams.frames_dropped();
  status.connected_s = to_seconds(now - since());
  return status;
}

}  // namespace fiducap::qualisys
