#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include "base/expected.hpp"
#include "streaming/net/tcp_listener.hpp"
#include "streaming/vicon/session.hpp"
#include "streaming/vicon/vicon_config.hpp"

namespace fiducap::vicon {

/// Listens, makes a session for every client and offers each frame to all of them. Everything runs
/// on the thread of the io_context.
class Server final : public std::enable_shared_from_this<Server> {
 public:
  Server(boost::asio::io_context& io, const ViconConfig& config, const Clock& clock);

  /// @return Error naming port and remedy
  Expected<void> listen();
  void publish(const std::shared_ptr<const SceneFrame>& frame);
  void append_clients(std::vector<ClientStatus>& out) const;
  void stop();
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  using tcp = boost::asio::ip::tcp;

  void accepted(tcp::socket socket);
  [[nodiscard]] bool has_room_for(const tcp::endpoint& client);
  void tick();
  void sweep();

  boost::asio::io_context& io_;
  ViconConfig config_;
  std::shared_ptr<SessionContext> context_;
  std::optional<net::TcpListener> listener_;
  boost::asio::steady_timer timer_;
  std::uint16_t port_{0};
  bool stopped_{false};
  bool may_complain_{true};  ///< About a lack of room, once per tick: clients cannot flood the log.
  std::vector<std::shared_ptr<Session>> sessions_;
};

}  // namespace fiducap::vicon
