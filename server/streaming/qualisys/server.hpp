#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/net/datagram_batch.hpp"
#include "streaming/net/tcp_listener.hpp"
#include "streaming/qualisys/discovery.hpp"
#include "streaming/qualisys/session.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::qualisys {

/// Listeners, sessions, and the fan-out of frames: each is encoded once per profile, and goes to
/// all its UDP readers by one call.
class Server final : public std::enable_shared_from_this<Server> {
 public:
  Server(boost::asio::io_context& io, const QualisysConfig& config, OperatorDesk* desk,
         const Clock& clock);

  [[nodiscard]] Expected<void> listen(const SceneModel& model);
  void publish(const std::shared_ptr<const SceneFrame>& frame);
  void append_clients(std::vector<ClientStatus>& out) const;
  void stop();
  [[nodiscard]] std::uint16_t base_port() const { return base_port_; }
  [[nodiscard]] std::uint16_t discovery_port() const;

 private:
  using tcp = boost::asio::ip::tcp;

  Expected<void> open_doors(std::uint16_t base_port);
  Expected<net::TcpListener> open_door(Door door, std::uint16_t port);
  void open_discovery();
  void accepted(tcp::socket socket, Door door);
  [[nodiscard]] bool has_room_for(const tcp::endpoint& client);
  void tell_all(Event event);
  void send_frame(Session& session, const SceneFrame& frame);
  void send_datagrams();
  void tick();
  void sweep();
  void close_all();

  boost::asio::io_context& io_;
  const Clock& clock_;
  std::shared_ptr<Room> room_;
  std::vector<net::TcpListener> doors_;
  std::optional<boost::asio::ip::udp::socket> udp_;
  std::shared_ptr<Discovery> discovery_;
  boost::asio::steady_timer timer_;
  std::uint16_t base_port_{0};
  std::uint64_t next_client_{1};
  bool stopped_{false};
  bool may_complain_{true};  ///< About a lack of room, once per tick: clients cannot flood the log.
  std::vector<std::shared_ptr<Session>> sessions_;
  net::DatagramBatch batch_;
  std::vector<Event> events_;
};

}  // namespace fiducap::qualisys
