#include <sstream>
#include <utility>

#include "base/handover.hpp"
#include "middleware/net/networks.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/net/tcp_server.hpp"
#include "streaming/vrpn/codec.hpp"
#include "streaming/vrpn/session.hpp"
#include "streaming/vrpn/vrpn.hpp"

namespace fiducap::vrpn {

namespace {

bool is_box(const std::array<double, 6>& box) {
  for (std::size_t i = 0; i < 3; ++i)
    if (!std::isfinite(box[i]) || !std::isfinite(box[i + 3]) || box[i] >= box[i + 3]) return false;
  return true;
}

bool is_pose(const Pose& X) {
  return X.p.allFinite() && X.q.coeffs().allFinite() && std::abs(X.q.norm() - 1.0) < 1e-3;
}

std::string text_of(const std::array<double, 6>& box) {
  std::ostringstream text;
  for (std::size_t i = 0; i < box.size(); ++i) text << (i == 0 ? "[" : ", ") << box[i];
  return text.str() + "]";
}

constexpr int kBindAttempts = 16;  // for port 0: the number that TCP got may be taken for UDP
constexpr std::size_t kLongestRequest = 200;
constexpr Duration kConnectTime = std::chrono::milliseconds(1500);
// Bytes sent to an address that did not ask: a SYN and one repeat within kConnectTime, with
// headers. Received datagrams count with their headers, too.
constexpr std::size_t kConnectBytes = 2 * 60;
constexpr std::size_t kHeaderBytes = 28;
constexpr std::string_view kKey = "streaming.vrpn";

/// Listens on TCP, connects back to clients that ask by UDP, and sends each frame to all sessions:
/// the same bytes for all, by one system call for those that use UDP.
class VrpnServer final : public Streamer {
 public:
  VrpnServer(const ProtocolContext& context, const VrpnConfig& config)
      : Streamer("vrpn"),
        io_(context.io),
        context_(std::make_shared<SessionContext>(SessionContext{config, context.clock})),
        encoder_(config.axes(), {config.velocity, config.acceleration}),
        tcp_(context.io, {"vrpn", config.max_clients, 0, kKey}, context.clock) {}

  /// Binds the sockets and starts listening. @return Error with port and remedy
  [[nodiscard]] Expected<void> listen(const SceneModel& model) {
    Expected<void> bound = bind(context_->config.port);
    for (int i = 1; i < kBindAttempts && !bound && context_->config.port == 0; ++i) bound = bind(0);
    if (!bound) return bound;
    take_over(model);
    requests_->start([this](const auto& request) { connect_back(request); });
    tcp_.start();
    return {};
  }

  void publish(const std::shared_ptr<const SceneFrame>& newest) override {
    const SceneFrame& frame = *newest;
    context_->utc_offset = frame.utc_offset;
    report_changes(frame);
    bool has_clients = false;
    tcp_.each<Session>(
        [&](const Session& session) { has_clients = has_clients || session.open(); });
    if (!has_clients) return;
    const auto reports = frames_.acquire();
    encoder_.encode(frame, context_->senders.of_bodies(), sensors_of_body_, *reports);
    if (reports->bytes.empty()) return;
    number_messages(reports->bytes, context_->sequence);
    reports_->batch().clear();
    tcp_.each<Session>([&](Session& session) { send_frame(session, reports); });
    reports_->send_batch();
    tcp_.each<Session>([&](Session& session) { session.datagrams.settle(reports_->batch()); });
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    const Instant now = context_->clock.now();
    tcp_.each<Session>([&](const Session& session) {
      if (session.open()) out.push_back(session.status(now));
    });
  }

  void stop() override {
    if (requests_) requests_->stop();
    tcp_.stop();
  }

 private:
  Expected<void> bind(std::uint16_t port) {
    const std::string& address = context_->config.address;
    tcp_.close_listeners();
    const auto bound =
        tcp_.listen({address, port, kKey}, [this](net::Socket socket, const net::Peer&) {
          return session(std::move(socket), Origin::kDirect);
        });
    if (!bound) return tl::unexpected(bound.error());
    auto requests = net::UdpServer::open(io_, {address, *bound, kKey}, {"vrpn", kLongestRequest});
    if (!requests) return tl::unexpected(requests.error());
    auto reports = net::UdpServer::open(io_, {address, 0, kKey}, {"vrpn"});
    if (!reports) return tl::unexpected(reports.error());
    port_ = *bound;
    requests_.emplace(std::move(*requests));
    reports_.emplace(std::move(*reports));
    return {};
  }

  [[nodiscard]] std::shared_ptr<Session> session(net::Socket socket, Origin origin) {
    return std::make_shared<Session>(context_, std::move(socket), origin);
  }

  /// Connects only to the source of the datagram, with at most three times the received bytes: a
  /// forged request cannot flood a third party. Clients repeat requests and accept one connection.
  void connect_back(const net::UdpServer::Datagram& request) {
    const std::uint64_t address = net::address_hash(key_, request.from);
    unproven_.count_received(address, request.bytes.size() + kHeaderBytes);
    const auto port = decode_request(request.bytes);
    if (!port)
      return log::debug("vrpn", net::address_text(request.from) + " " + port.error().text());
    const net::Peer client = request.from.with_port(*port);
    bool served = false;
    tcp_.each<Session>([&](const Session& session) {
      served = served || (session.origin() == Origin::kRequested && session.peer() == client);
    });
    if (served || !unproven_.take(address, kConnectBytes)) return;
    tcp_.connect(client, kConnectTime, [this](net::Socket socket, const net::Peer&) {
      return session(std::move(socket), Origin::kRequested);
    });
  }

  void take_over(const SceneModel& model) {
    if (generation_ == model.generation) return;
    generation_ = model.generation;
    sensors_of_body_.clear();
    if (!context_->config.sensors.empty()) {
      for (const auto& body : model.bodies)
        sensors_of_body_.push_back(context_->config.sensors_of(body.name));
    }
    for (const auto& name : context_->senders.update(model))
      log::error("vrpn", "the body \"" + name +
                             "\" is not served: its name is doubled or breaks VRPN's rules");
  }

  void report_changes(const SceneFrame& frame) {
    if (frame.model != nullptr) {
      const std::size_t known = context_->senders.names().size();
      take_over(*frame.model);
      if (context_->senders.names().size() > known)
        tcp_.each<Session>([](Session& session) { session.describe_new_senders(); });
    }
    texts_.clear();
    watch_.observe(frame, context_->senders.of_bodies(), texts_);
    if (texts_.empty()) return;
    number_messages(texts_, context_->sequence);
    tcp_.each<Session>([&](Session& session) {
      if (session.open()) session.send(texts_);
    });
  }

  void send_frame(Session& session, const std::shared_ptr<const EncodedFrame>& reports) {
    session.datagrams.clear();
    if (!session.open()) return;
    if (!session.udp_port()) return session.offer(net::SharedBytes(reports, &reports->bytes));
    // The address of the TCP peer: a client cannot redirect reports.
    const net::Peer target = session.peer().with_port(*session.udp_port());
    session.datagrams.open(reports_->batch());
    if (const std::size_t cut = reports->equal_cut(); cut > 0) {
      reports_->add_cut(reports->bytes, cut, target);
    } else {
      std::size_t begin = 0;
      for (const std::size_t end : reports->datagram_ends) {
        reports_->add(std::span(reports->bytes).subspan(begin, end - begin), target);
        begin = end;
      }
    }
    session.datagrams.close(reports_->batch());
  }

  boost::asio::io_context& io_;
  std::shared_ptr<SessionContext> context_;

  ReportEncoder encoder_;
  std::vector<std::vector<Pose>> sensors_of_body_;
  BodyWatch watch_;
  ObjectPool<EncodedFrame> frames_;
  std::vector<std::byte> texts_;
  std::optional<std::uint64_t> generation_;

  std::array<std::uint64_t, 2> key_{net::random_key()};
  net::AnswerBudget unproven_;
  std::optional<net::UdpServer> requests_;
  std::optional<net::UdpServer> reports_;
  net::TcpServer tcp_;
};

}  // namespace

std::vector<Pose> VrpnConfig::sensors_of(std::string_view body) const {
  std::vector<Pose> all;
  for (const ExtraSensor& sensor : sensors)
    if (sensor.body == body) all.push_back({sensor.X_PS.q.normalized(), sensor.X_PS.p});
  return all;
}

std::vector<ConfigError> VrpnConfig::check() const {
  auto errors = Checker{"streaming.vrpn."}
                    .require(net::parse_address(address).has_value(), "address", address,
                             "must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all")
                    .within("max_clients", max_clients, 1, 256)
                    .within("minor_version", minor_version, 0, 99)
                    .require(is_box(workspace_box_m), "workspace_box_m", text_of(workspace_box_m),
                             "must be min x y z, max x y z, finite, each min below its max")
                    .errors;
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const auto of_body = static_cast<int>(sensors_of(sensors[i].body).size());
    const auto broken =
        Checker{"streaming.vrpn.sensors." + std::to_string(i) + "."}
            .require(!sensors[i].body.empty() && of_body < kMaxSensors, "body",
                     '"' + sensors[i].body + '"', "must name a body, at most four times")
            .require(is_pose(sensors[i].X_PS), "X_PS", "{…}",
                     "must be finite, with a unit quaternion")
            .errors;
    errors.insert(errors.end(), broken.begin(), broken.end());
  }
  return errors;
}

ServedProtocol VrpnConfig::served() const {
  return {"vrpn",  enabled,
          address, {{port, false}, {port, true}},
          axes(),  conventions_of("vrpn").when_invalid};
}

StartedStreamer serve(const ProtocolContext& context, const VrpnConfig& config) {
  auto server = std::make_unique<VrpnServer>(context, config);
  if (auto listening = server->listen(*context.model); !listening)
    return tl::unexpected(listening.error());
  log::info("vrpn", "serves VRPN 07." + std::to_string(config.minor_version) + " on " +
                        config.address + ":" + std::to_string(server->port()) + " (TCP and UDP)");
  return server;
}

}  // namespace fiducap::vrpn
