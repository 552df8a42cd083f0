#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <memory>
#include <string>

#include "streaming/net/datagram_batch.hpp"
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
  void count_udp(bool whole) { ++udp_offered_, udp_dropped_ += whole ? 0 : 1; }
  [[nodiscard]] ClientStatus status(Instant now) const;
  /// Set when the last batch holds datagrams of this client.
  struct Batched {
    std::size_t begin{0};
    std::size_t end{0};
  };
  Batched batched;

 private:
  void received(std::span<const std::byte> bytes) override;
  void ticked(Instant now) override;

  std::shared_ptr<Room> room_;
  Connection connection_;
  sockaddr_in udp_target_{};
  std::uint64_t udp_offered_{0};
  std::uint64_t udp_dropped_{0};
};

}  // namespace fiducap::qualisys
