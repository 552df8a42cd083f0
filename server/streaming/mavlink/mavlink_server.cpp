#include <algorithm>
#include <set>
#include <utility>

#include "base/log.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/mavlink/mavlink.hpp"
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
  std::uint64_t refused{0};
};

class MavlinkServer final : public Streamer {
 public:
  MavlinkServer(net::UdpServer udp, const MavlinkConfig& config, const SceneModel& model,
                const Clock& clock)
      : Streamer("mavlink"), clock_(clock), started_(clock.now()), udp_(std::move(udp)) {
    port_ = udp_.port();
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
      const auto found = std::ranges::find(frame.bodies, vehicle.body_id, &BodyPose::body_id);
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
      if (!vehicle.datagram.empty() && !udp_.batch().sent(place++)) ++vehicle.refused;
    }
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    const Instant now = clock_.now();
    for (const auto& vehicle : vehicles_) {
      std::optional<ClockOffset> clock;  // by TIMESYNC; nullopt: no recent reply
      if (const auto offset = vehicle.link.clock_offset(now))
        clock = ClockOffset{-to_seconds(offset->to_autopilot), to_seconds(offset->bound)};
      out.push_back({"mavlink", net::text_of(vehicle.peer) + " udp", vehicle.link.status(now),
                     vehicle.link.poses(), vehicle.refused, to_seconds(now - started_), clock});
    }
  }

  void stop() override { udp_.stop(); }

 private:
  /// By name once, then by id: a renamed body remains the same vehicle.
  static std::optional<int> body_called(const SceneModel& model, const std::string& name) {
    for (const auto& body : model.bodies)
      if (body.name == name) return body.id;
    log::warning("mavlink", "no body is called " + name + ": its autopilot gets heartbeats only");
    return std::nullopt;
  }

  void receive(const net::UdpServer::Datagram& datagram) {
    const auto vehicle = std::ranges::find(vehicles_, datagram.from, &Vehicle::peer);
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

std::vector<ConfigError> MavlinkConfig::check() const {
  const auto is_ipv4 = [](const std::string& text) { return net::parse_address(text).has_value(); };
  Checker all{"streaming.mavlink."};
  all.require(is_ipv4(address), "address", '"' + address + '"',
              "must be an IPv4 address, e.g. 0.0.0.0")
      .require(vehicles.size() <= 64, "vehicles", std::to_string(vehicles.size()) + " entries",
               "must be at most 64");
  std::set<std::pair<std::string, std::uint16_t>> peers;
  for (std::size_t i = 0; i < vehicles.size(); ++i) {
    const VehicleConfig& vehicle = vehicles[i];
    Checker one{"streaming.mavlink.vehicles." + std::to_string(i) + "."};
    one.require(!vehicle.body.empty(), "body", "\"\"", "must name one of the bodies")
        .require(is_ipv4(vehicle.address), "address", '"' + vehicle.address + '"',
                 "must be an IPv4 address")
        .require(vehicle.port > 0, "port", vehicle.port, "must be in [1, 65535]")
        .require(peers.emplace(vehicle.address, vehicle.port).second, "port", vehicle.port,
                 "is another vehicle's, too: each has an address of its own")
        .within("rate_hz", vehicle.rate_hz, 1, 200)
        .within("system_id", vehicle.system_id, 1, 255)
        .within("component_id", vehicle.component_id, 1, 255);
    all.errors.insert(all.errors.end(), one.errors.begin(), one.errors.end());
  }
  return all.errors;
}

ServedProtocol MavlinkConfig::served() const {
  const ProtocolConventions& conventions = conventions_of("mavlink");
  return {"mavlink", enabled, address, {{port, true}}, conventions.axes, conventions.when_invalid};
}

std::vector<ConfigError> MavlinkConfig::check_bodies(const std::vector<std::string>& names) const {
  std::vector<ConfigError> errors;
  for (std::size_t i = 0; i < vehicles.size(); ++i) {
    const std::string& name = vehicles[i].body;
    if (name.empty() || std::find(names.begin(), names.end(), name) != names.end()) continue;
    errors.push_back({"streaming.mavlink.vehicles." + std::to_string(i) + ".body", '"' + name + '"',
                      "must be the name of one of the bodies"});
  }
  return errors;
}

StartedStreamer serve(const ProtocolContext& context, const MavlinkConfig& config) {
  auto udp = net::UdpServer::open(context.io, {config.address, config.port, "streaming.mavlink"},
                                  {"mavlink", kLongestDatagram});
  if (!udp) return tl::unexpected(udp.error());
  auto server =
      std::make_unique<MavlinkServer>(std::move(*udp), config, *context.model, context.clock);
  log::info("mavlink", "serves " + std::to_string(config.vehicles.size()) + " autopilot(s) from " +
                           config.address + ":" + std::to_string(server->port()) + " (UDP)");
  return server;
}

}  // namespace fiducap::mavlink
