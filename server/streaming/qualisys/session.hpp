#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <memory>
#include <string>

#include "streaming/net/datagram_share.hpp"
#include "streaming/net/tcp_session.hpp"
#include "streaming/qualisys/connection.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::qualisys {

/// One client's TCP socket and its conversation. Where its stream goes by UDP, the server sends it.
class Session final : public net::TcpSession {
 public:
  Session(tcp::socket socket, std::shared_ptr<Room> room, Door door, std::uint64_t id,
          const Clock& clock);

  [[nodiscard]] Connection& connection() { return connection_; }
  void greet();
  void tell(Event event);
  /// One GetCurrentFrame gets the newest frame, if it has not had it yet.
  void answer_current();

  /// Where UDP goes: the TCP peer's address and the port that it named.
  [[nodiscard]] const sockaddr_in& udp_target();
  [[nodiscard]] ClientStatus status(Instant now) const;
  net::DatagramShare datagrams;

 private:
  void received(std::span<const std::byte> bytes) override;
  void ticked(Instant now) override;

  std::shared_ptr<Room> room_;
  Connection connection_;
};

}  // namespace fiducap::qualisys
