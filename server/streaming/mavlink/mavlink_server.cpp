#include "streaming/mavlink/mavlink_server.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include "base/log.hpp"
#include "streaming/conventions/pose_jumps.hpp"
#include "streaming/mavlink/vehicle_link.hpp"
#include "streaming/net/udp_server.hpp"

namespace fiducap::mavlink {

namespace {

constexpr std::size_t kLongestDatagram = 2048;

struct Vehicle {
  VehicleLink link;
  net::Peer peer;
  std::optional<int> body_id;
  std::vector<std::byte> datagram;
  std::uint64_t sent{0};
  std::uint64_t refused{0};
};

class MavlinkServer final : public MavlinkStreamer {
 public:
  MavlinkServer(net::UdpServer udp, const MavlinkConfig& config, const SceneModel& model,
                const Clock& clock)
      : clock_(clock), started_(clock.now()), udp_(std::move(udp)) {
    for (const auto& vehicle : config.vehicles) {
      vehicles_.push_back({VehicleLink(vehicle),
                           {net::parse_address(vehicle.address).value_or(0), vehicle.port},
                           body_called(model, vehicle.body),
                           {}});
      vehicles_.back().datagram.reserve(kLongestDatagram);
    }
    udp_.start([this](const auto& datagram) { receive(datagram); });
  }

  void publish(const std::shared_ptr<const SceneFrame>& newest) override {
    if (!udp_.is_open()) return;
    const SceneFrame& frame = *newest;
    jumps_.observe(frame);
    const Instant now = clock_.now();
    udp_.batch().clear();
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
      udp_.add(vehicle.datagram, vehicle.peer);
    }
    udp_.send_batch();
    std::size_t place = 0;
    for (auto& vehicle : vehicles_) {
      if (!vehicle.datagram.empty())
        ++(udp_.batch().sent(place++) ? vehicle.sent : vehicle.refused);
    }
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    const Instant now = clock_.now();
    for (const auto& vehicle : vehicles_) {
      out.push_back({"mavlink", net::text_of(vehicle.peer) + " udp", vehicle.link.status(now),
                     vehicle.link.poses(), vehicle.refused, to_seconds(now - started_),
                     clock_of(vehicle.link, now)});
    }
  }

  void stop() override { udp_.stop(); }
  [[nodiscard]] std::string_view protocol() const override { return "mavlink"; }
  [[nodiscard]] std::uint16_t port() const override { return udp_.port(); }

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

  void receive(const net::UdpServer::Datagram& datagram) {
    const auto vehicle =
        std::find_if(vehicles_.begin(), vehicles_.end(),
                     [&](const Vehicle& known) { return known.peer == datagram.from; });
    if (vehicle == vehicles_.end()) return;
    answers_.clear();
    vehicle->link.receive(datagram.bytes, clock_.now(), answers_);
    if (!answers_.empty()) udp_.send(answers_, datagram.from);
  }

  const Clock& clock_;
  Instant started_;
  std::vector<Vehicle> vehicles_;
  PoseJumps jumps_;
  std::vector<std::byte> answers_;
  net::UdpServer udp_;
};

}  // namespace

Expected<std::unique_ptr<MavlinkStreamer>> start_mavlink_server(
    boost::asio::io_context& io, const MavlinkConfig& config,
    std::shared_ptr<const SceneModel> model, const Clock& clock) {
  auto udp = net::UdpServer::open(io, {config.address, config.port, "streaming.mavlink"},
                                  {"mavlink", kLongestDatagram});
  if (!udp) return tl::unexpected(udp.error());
  auto server = std::make_unique<MavlinkServer>(std::move(*udp), config, *model, clock);
  log::info("mavlink", "serves " + std::to_string(config.vehicles.size()) + " autopilot(s) from " +
                           config.address + ":" + std::to_string(server->port()) + " (UDP)");
  return server;
}

}  // namespace fiducap::mavlink
