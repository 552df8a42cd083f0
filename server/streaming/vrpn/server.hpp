#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>

#include "base/expected.hpp"
#include "base/object_pool.hpp"
#include "streaming/vrpn/body_watch.hpp"
#include "streaming/vrpn/report_encoder.hpp"
#include "streaming/vrpn/session.hpp"

namespace fiducap::vrpn {

/// Listens on TCP and UDP, makes a session for every client and hands each frame to all of them.
/// Everything runs on the thread of the io_context.
class Server final : public std::enable_shared_from_this<Server> {
 public:
  Server(boost::asio::io_context& io, const VrpnConfig& config, const Clock& clock);

  /// Binds both sockets and starts listening. @return Error naming port and remedy.
  Expected<void> listen(const SceneModel& model);
  void publish(const SceneFrame& frame);
  void append_clients(std::vector<ClientStatus>& out) const;
  void stop();
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  using tcp = boost::asio::ip::tcp;
  using udp = boost::asio::ip::udp;

  Expected<void> bind(std::uint16_t port);
  void accept();
  void accepted(tcp::socket socket);
  void receive_request();
  void serve_request(std::size_t size);
  void tick();
  void take_over(const SceneModel& model);
  [[nodiscard]] bool has_room_for(const tcp::endpoint& client) const;
  void begin(const std::shared_ptr<Session>& session);
  void sweep();

  boost::asio::io_context& io_;
  std::shared_ptr<SessionContext> context_;
  tcp::acceptor acceptor_;
  udp::socket requests_;
  boost::asio::steady_timer timer_;
  std::uint16_t port_{0};
  bool stopped_{false};
  bool accepting_{false};
  bool receiving_{false};
  int ticks_{0};
  udp::endpoint requester_;
  std::array<std::byte, 200> request_{};
  std::vector<std::shared_ptr<Session>> sessions_;

  ReportEncoder encoder_;
  BodyWatch watch_;
  ObjectPool<EncodedFrame> frames_;
  std::vector<std::byte> numbered_;
  std::vector<std::byte> texts_;
};

}  // namespace fiducap::vrpn
