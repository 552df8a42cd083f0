#include "streaming/mavlink/mavlink_server.hpp"

#include <algorithm>
#include <array>
#include <boost/asio/buffer.hpp>
#include <optional>
#include <vector>

#include "base/log.hpp"
#include "streaming/conventions/pose_jumps.hpp"
#include "streaming/mavlink/vehicle_link.hpp"
#include "streaming/net/bind.hpp"
#include "streaming/net/datagram_batch.hpp"
#include "streaming/server_handle.hpp"

namespace fiducap::mavlink {

namespace {

namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

// Datagrams handled before other work of the I/O thread gets its turn.
constexpr int kDatagramsPerTurn = 64;
constexpr std::size_t kLongestDatagram = 2048;

struct Vehicle {
  VehicleLink link;
  udp::endpoint peer;
  std::optional<int> body_id;
  std::vector<std::byte> datagram;
  std::uint64_t sent{0};
  std::uint64_t refused{0};
};

/// Shared with the one pending wait of the socket, which may outlive the streamer in the I/O queue.
class MavlinkServer final : public std::enable_shared_from_this<MavlinkServer> {
 public:
  MavlinkServer(udp::socket socket, const MavlinkConfig& config, const SceneModel& model,
                const Clock& clock)
      : clock_(clock), socket_(std::move(socket)), started_(clock.now()) {
    for (const auto& vehicle : config.vehicles) {
      const udp::endpoint peer(asio::ip::make_address(vehicle.address), vehicle.port);
      vehicles_.push_back({VehicleLink(vehicle), peer, body_called(model, vehicle.body), {}});
      vehicles_.back().datagram.reserve(kLongestDatagram);
    }
  }

  void listen() {
    socket_.async_wait(udp::socket::wait_read, [weak = weak_from_this()](const error_code& error) {
      const auto self = weak.lock();
      if (!self || error || !self->socket_.is_open()) return;
      self->read();
      self->listen();
    });
  }

  void publish(const std::shared_ptr<const SceneFrame>& newest) {
    if (!socket_.is_open()) return;
    const SceneFrame& frame = *newest;
    jumps_.observe(frame);
    const Instant now = clock_.now();
    batch_.clear();
    for (auto& vehicle : vehicles_) {
      vehicle.datagram.clear();
      const auto found =
          std::find_if(frame.bodies.begin(), frame.bodies.end(),
                       [&](const BodyPose& body) { return body.body_id == vehicle.body_id; });
      const bool there = found != frame.bodies.end();
      const auto jumps =
          there ? jumps_.count(static_cast<std::size_t>(found - frame.bodies.begin())) : 0;
      vehicle.link.publish(frame, there ? &*found : nullptr, jumps, now, vehicle.datagram);
      if (vehicle.datagram.empty()) continue;
      batch_.add(vehicle.datagram, vehicle.peer.data(),
                 static_cast<socklen_t>(vehicle.peer.size()));
    }
    batch_.send(socket_.native_handle());
    std::size_t place = 0;
    for (auto& vehicle : vehicles_) {
      if (!vehicle.datagram.empty()) ++(batch_.sent(place++) ? vehicle.sent : vehicle.refused);
    }
  }

  void append_clients(std::vector<ClientStatus>& out) const {
    const Instant now = clock_.now();
    for (const auto& vehicle : vehicles_) {
      out.push_back({"mavlink", net::peer_text(vehicle.peer), vehicle.link.status(now),
                     vehicle.link.poses(), vehicle.refused, to_seconds(now - started_),
                     clock_of(vehicle.link, now)});
    }
  }

  void stop() {
    error_code ignored;
    socket_.close(ignored);
  }

  [[nodiscard]] std::uint16_t port() const {
    error_code ignored;
    return socket_.local_endpoint(ignored).port();
  }

 private:
  /// By TIMESYNC; nothing: no answer of late.
  static std::optional<ClockOffset> clock_of(const VehicleLink& link, Instant now) {
    const auto offset = link.clock_offset(now);
    if (!offset) return std::nullopt;
    return ClockOffset{-to_seconds(offset->to_autopilot), to_seconds(offset->doubt)};
  }
  /// By name once, then by id: a renamed body is still the same vehicle.
  static std::optional<int> body_called(const SceneModel& model, const std::string& name) {
    for (const auto& body : model.bodies) {
      if (body.name == name) return body.id;
    }
    log::warning("mavlink", "no body is called " + name + ": its autopilot gets heartbeats only");
    return std::nullopt;
  }

  void read() {
    udp::endpoint from;
    for (int i = 0; i < kDatagramsPerTurn; ++i) {
      error_code error;
      const auto size = socket_.receive_from(asio::buffer(request_), from, 0, error);
      if (error == asio::error::would_block) return;
      if (error) continue;  // an earlier datagram of ours came back as unreachable
      const auto vehicle = std::find_if(vehicles_.begin(), vehicles_.end(),
                                        [&](const Vehicle& known) { return known.peer == from; });
      if (vehicle == vehicles_.end()) continue;
      answers_.clear();
      vehicle->link.receive(std::span(request_).first(size), clock_.now(), answers_);
      if (!answers_.empty()) socket_.send_to(asio::buffer(answers_), from, 0, error);
    }
  }

  const Clock& clock_;
  udp::socket socket_;
  Instant started_;
  std::vector<Vehicle> vehicles_;
  PoseJumps jumps_;
  net::DatagramBatch batch_;
  std::vector<std::byte> answers_;
  std::array<std::byte, kLongestDatagram> request_{};
};

class Owner final : public ServerHandle<MavlinkStreamer, MavlinkServer> {
 public:
  using ServerHandle::ServerHandle;
  [[nodiscard]] std::uint16_t port() const override { return server().port(); }
};

}  // namespace

Expected<std::unique_ptr<MavlinkStreamer>> start_mavlink_server(
    asio::io_context& io, const MavlinkConfig& config, std::shared_ptr<const SceneModel> model,
    const Clock& clock) {
  auto socket = net::bind_udp(io, {config.address, config.port, "streaming.mavlink"});
  if (!socket) return tl::unexpected(socket.error());
  auto server = std::make_shared<MavlinkServer>(std::move(*socket), config, *model, clock);
  server->listen();
  log::info("mavlink", "serves " + std::to_string(config.vehicles.size()) + " autopilot(s) from " +
                           config.address + ":" + std::to_string(server->port()) + " (UDP)");
  return std::make_unique<Owner>("mavlink", std::move(server));
}

}  // namespace fiducap::mavlink
