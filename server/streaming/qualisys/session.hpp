#pragma once

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
  Session(net::Socket socket, std::shared_ptr<SharedState> shared, Dialect dialect,
          std::uint64_t id, const Clock& clock);

  [[nodiscard]] Connection& connection() { return connection_; }
  void start() override;
  void tell(Event event);
  /// One GetCurrentFrame gets the newest frame, if it has not had it yet.
  void answer_current();

  [[nodiscard]] ClientStatus status(Instant now) const;
  net::DatagramShare datagrams;

 private:
  void received(std::span<const std::byte> bytes) override;
  void ticked(Instant now) override;
  void ended() override { connection_.leave(); }

  std::shared_ptr<SharedState> shared_;
  Connection connection_;
};

}  // namespace fiducap::qualisys
