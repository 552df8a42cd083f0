#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>

#include "base/expected.hpp"
#include "base/object_pool.hpp"
#include "streaming/net/datagram_batch.hpp"
#include "streaming/net/tcp_listener.hpp"
#include "streaming/vrpn/body_watch.hpp"
#include "streaming/vrpn/connect_back.hpp"
#include "streaming/vrpn/report_encoder.hpp"
#include "streaming/vrpn/session.hpp"

namespace fiducap::vrpn {

/// Listens on TCP and UDP, makes a session for every client and hands each frame to all of them:
/// the same bytes to everybody, by one call for all that take them by UDP. Everything runs on the
/// thread of the io_context.
class Server final : public std::enable_shared_from_this<Server> {
 public:
  Server(boost::asio::io_context& io, const VrpnConfig& config, const Clock& clock);

  /// Binds the sockets and starts listening. @return Error naming port and remedy.
  Expected<void> listen(const SceneModel& model);
  void publish(const std::shared_ptr<const SceneFrame>& frame);
  void append_clients(std::vector<ClientStatus>& out) const;
  void stop();
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  using tcp = boost::asio::ip::tcp;
  using udp = boost::asio::ip::udp;

  Expected<void> bind(std::uint16_t port);
  void begin(tcp::socket socket, Origin origin);
  void tick();
  void take_over(const SceneModel& model);
  [[nodiscard]] bool wants(const tcp::endpoint& client) const;
  [[nodiscard]] bool has_room_for(const tcp::endpoint& client) const;
  void say_changes(const SceneFrame& frame);
  void send_frame(Session& session, const std::shared_ptr<const EncodedFrame>& reports);
  void send_datagrams();
  void sweep();

  boost::asio::io_context& io_;
  std::shared_ptr<SessionContext> context_;
  std::optional<net::TcpListener> listener_;
  std::shared_ptr<ConnectBack> requests_;
  std::optional<udp::socket> reports_;
  boost::asio::steady_timer timer_;
  std::uint16_t port_{0};
  bool stopped_{false};
  int ticks_{0};
  std::vector<std::shared_ptr<Session>> sessions_;

  ReportEncoder encoder_;
  std::vector<std::vector<Pose>> sensors_of_body_;
  BodyWatch watch_;
  ObjectPool<EncodedFrame> frames_;
  net::DatagramBatch batch_;
  std::vector<std::byte> texts_;
  std::optional<std::uint64_t> generation_;
};

}  // namespace fiducap::vrpn
