#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "streaming/native/event_news.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/net/tcp_server.hpp"
#include "streaming/operator_desk.hpp"

namespace fiducap::native {

/// The control channel: at most kMostClients connections, commands of who knows the operator's
/// token, events for everybody.
class ControlServer final {
 public:
  static constexpr int kMostClients = 32;
  static constexpr int kMostPerAddress = 8;

  /// @param events  nullptr: nothing can be watched
  ControlServer(boost::asio::io_context& io, OperatorDesk& desk, const EventBoard* events,
                const Clock& clock);
  /// @return Error with the remedy when the port cannot be had
  [[nodiscard]] Expected<void> listen(const net::BindTarget& target);
  void stop() { tcp_.stop(); }

 private:
  class Session;
  [[nodiscard]] std::shared_ptr<net::Session> session(net::Socket socket, const net::Peer& peer);

  OperatorDesk& desk_;
  std::optional<EventNews> news_;
  const Clock& clock_;
  std::array<std::uint64_t, 2> hash_key_;
  net::WrongProofs wrong_;
  net::TcpServer tcp_;
};

}  // namespace fiducap::native
