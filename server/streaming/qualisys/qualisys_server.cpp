#include <algorithm>

#include "base/log.hpp"
#include "middleware/net/networks.hpp"
#include "streaming/net/interfaces.hpp"
#include "streaming/net/tcp_server.hpp"
#include "streaming/qualisys/control.hpp"
#include "streaming/qualisys/qualisys.hpp"
#include "streaming/qualisys/session.hpp"

namespace fiducap::qualisys {

namespace {

bool is_short_text(const std::string& text) {
  return !text.empty() && text.size() <= 60 &&
         std::ranges::all_of(text, [](char c) { return c >= 0x20 && c < 0x7f; });
}

constexpr Duration kStopDelay = std::chrono::milliseconds(50);
constexpr std::string_view kKey = "streaming.qualisys";
constexpr int kBindAttempts = 32;  // for port 0: three in a row must be free
constexpr std::uint16_t kLastFreeBase = 65'533;
constexpr std::size_t kLongestQuestion = 64;

/// A broadcast does not reach a socket that is bound to one interface's address.
std::string discovery_address(const QualisysConfig& config) {
  const auto address = net::parse_address(config.address);
  const bool loopback = address && net::Peer{*address, 0}.is_loopback();
  return loopback ? config.address : "0.0.0.0";
}

/// Listeners, discovery, and the fan-out of frames: each is encoded once per profile and sent to
/// all its UDP clients by one system call.
class QualisysServer final : public Streamer {
 public:
  QualisysServer(const ProtocolContext& context, const QualisysConfig& config)
      : Streamer("qualisys"),
        io_(context.io),
        clock_(context.clock),
        shared_(std::make_shared<SharedState>(config, context.operator_api)),
        tcp_(context.io, {"qualisys", config.max_clients, config.max_clients_per_address, kKey},
             context.clock) {}
  ~QualisysServer() override { QualisysServer::stop(); }

  [[nodiscard]] Expected<void> listen(const SceneModel& model) {
    const QualisysConfig& config = shared_->config;
    auto udp = net::UdpServer::open(io_, {config.address, 0, kKey, "address"}, {"qualisys"});
    if (!udp) return tl::unexpected(udp.error());
    udp_.emplace(std::move(*udp));
    Expected<void> opened = open_ports(config.base_port);
    for (int i = 1; i < kBindAttempts && !opened && config.base_port == 0; ++i)
      opened = open_ports(0);
    if (!opened) return opened;
    shared_->bodies.update(model);
    open_discovery();
    tcp_.start([this](Instant) { tick(); });
    return {};
  }

  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    if (stopped_) return;
    shared_->rate_hz = frame->rate_hz;
    if (frame->model != nullptr && shared_->bodies.update(*frame->model))
      send_to_all(Event::kCameraSettingsChanged);
    shared_->frames.put(frame, shared_->bodies);
    udp_->batch().clear();
    tcp_.each<Session>([&](Session& session) {
      session.answer_current();
      send_frame(session, *frame);
    });
    udp_->send_batch();
    tcp_.each<Session>([&](Session& session) { session.datagrams.settle(udp_->batch()); });
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    const Instant now = clock_.now();
    tcp_.each<Session>([&](const Session& session) { out.push_back(session.status(now)); });
  }

  void stop() override {
    if (std::exchange(stopped_, true)) return;
    if (discovery_) discovery_->stop();
    send_to_all(Event::kShuttingDown);
    tcp_.stop(kStopDelay);
  }

 private:
  Expected<void> open_ports(std::uint16_t base_port) {
    tcp_.close_listeners();
    const auto first = open_port(Dialect::kLegacy, base_port);
    if (!first) return tl::unexpected(first.error());
    if (*first > kLastFreeBase) return fail(ErrorCode::kUnavailable, "no three free ports");
    for (const Dialect dialect : {Dialect::kLittleEndian, Dialect::kBigEndian}) {
      const auto offset =
          dialect == Dialect::kLittleEndian ? kLittleEndianOffset : kBigEndianOffset;
      const auto next = open_port(dialect, static_cast<std::uint16_t>(*first + offset));
      if (!next) return tl::unexpected(next.error());
    }
    port_ = *first;
    return {};
  }

  Expected<std::uint16_t> open_port(Dialect dialect, std::uint16_t port) {
    return tcp_.listen({shared_->config.address, port, kKey, "base_port"},
                       [this, dialect](net::Socket socket, const net::Peer&) {
                         shared_->now = clock_.now();
                         return std::make_shared<Session>(std::move(socket), shared_, dialect,
                                                          next_client_++, clock_);
                       });
  }

  void open_discovery() {
    const QualisysConfig& config = shared_->config;
    if (config.discovery_port == 0) return;
    auto opened = net::UdpServer::open(
        io_, {discovery_address(config), config.discovery_port, kKey, "discovery_port"},
        {"qualisys", kLongestQuestion});
    if (!opened) {  // clients with a configured address work without it
      log::warning("qualisys", "discovery is not answered: " + opened.error().text());
      return;
    }
    about_ = net::host_name() + ", QTM " + config.qtm_version + ", 0 cameras";
    second_port_ = opened->port();
    discovery_.emplace(std::move(*opened));
    discovery_->start([this](const auto& question) { answer(question); });
  }

  void answer(const net::UdpServer::Datagram& question) {
    const Instant now = clock_.now();
    const bool is_trusted = senders_.count_received(question.from, question.bytes.size(), now);
    const auto port = decode_discover(question.bytes);
    if (!port) return;
    std::vector<std::byte> answer;
    encode_discover_answer(about_, port_, answer);
    const bool may_go = is_trusted ? answers_.allow(net::address_hash(key_, question.from), now)
                                   : senders_.may_answer_untrusted(question.from, answer.size());
    if (may_go) discovery_->send(answer, question.from.with_port(*port));
  }

  void send_to_all(Event event) {
    tcp_.each<Session>([event](Session& session) { session.send_event(event); });
  }

  void send_frame(Session& session, const SceneFrame& frame) {
    session.datagrams.clear();
    const auto profile = session.connection().stream_of(frame);
    if (!profile) return;
    const auto encoded = shared_->frames.encoded(*profile);
    if (!session.connection().udp_port())
      return session.offer(net::SharedBytes(encoded, &encoded->packet));
    // The address of the TCP peer: a client cannot redirect frames.
    const net::Peer target = session.peer().with_port(*session.connection().udp_port());
    session.datagrams.open(udp_->batch());
    std::size_t begin = 0;
    for (const std::size_t end : encoded->datagram_ends) {
      udp_->add(encoded->datagrams().subspan(begin, end - begin), target);
      begin = end;
    }
    session.datagrams.close(udp_->batch());
    if (encoded->datagram_ends.empty()) session.datagrams.drop();  // too long for any datagram
  }

  void tick() {
    shared_->now = clock_.now();
    events_.clear();
    shared_->control.observe(events_);
    for (const Event event : events_) send_to_all(event);
  }

  boost::asio::io_context& io_;
  const Clock& clock_;
  std::shared_ptr<SharedState> shared_;
  std::uint64_t next_client_{1};
  bool stopped_{false};
  std::vector<Event> events_;
  std::string about_;  ///< Text for discovery.
  // A discovery reply is longer than its request, whose sender is not proven.
  std::array<std::uint64_t, 2> key_{net::random_key()};
  net::SenderRule senders_{key_, net::TrustedNetworks({})};
  net::AnswerLimiter answers_;
  std::optional<net::UdpServer> udp_;
  std::optional<net::UdpServer> discovery_;
  net::TcpServer tcp_;
};

}  // namespace

std::vector<ConfigError> QualisysConfig::check() const {
  return Checker{"streaming.qualisys."}
      .require(net::parse_address(address).has_value(), "address", address,
               "must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all")
      .require(base_port <= 65535 - kBigEndianOffset, "base_port", std::to_string(base_port),
               "must leave room for the two ports behind it")
      .within("max_clients", max_clients, 1, 256)
      .within("max_clients_per_address", max_clients_per_address, 1, 256)
      .require(is_short_text(qtm_version), "qtm_version", qtm_version,
               "must be 1 to 60 printable characters")
      .errors;
}

ServedProtocol QualisysConfig::served() const {
  const auto tcp = [this](std::uint16_t offset) {
    return PortUse{static_cast<std::uint16_t>(base_port + offset), false, "base_port", offset};
  };
  std::vector<PortUse> ports{{0, false, "base_port"}};
  if (base_port != 0) ports = {tcp(0), tcp(kLittleEndianOffset), tcp(kBigEndianOffset)};
  if (discovery_port != 0)
    ports.push_back({discovery_port, true, "discovery_port", 0, true, discovery_address(*this)});
  // Bodies are identified by index: the list is fixed.
  const bool stop = when_invalid == WhenInvalid::kStop;
  return {"qualisys",       enabled, address,
          std::move(ports), axes(),  stop ? WhenInvalid::kFlag : when_invalid};
}

StartedStreamer serve(const ProtocolContext& context, const QualisysConfig& config) {
  auto server = std::make_unique<QualisysServer>(context, config);
  if (auto listening = server->listen(*context.model); !listening)
    return tl::unexpected(listening.error());
  const std::uint16_t base = server->port();
  log::info("qualisys", "serves QTM RT 1.0 to 1.28 on " + config.address + ":" +
                            std::to_string(base) + " to " + std::to_string(base + 2) + " (TCP)");
  return server;
}

}  // namespace fiducap::qualisys
