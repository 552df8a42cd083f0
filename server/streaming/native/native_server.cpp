#include "base/log.hpp"
#include "streaming/native/codec.hpp"
#include "streaming/native/control_session.hpp"
#include "streaming/native/native.hpp"
#include "streaming/native/registry.hpp"
#include "streaming/net/interfaces.hpp"
#include "streaming/net/udp_server.hpp"

namespace fiducap::native {

namespace {

// For a large scene and many clients; the kernel limits it to net.core.wmem_max.
constexpr int kSendBuffer = 16 << 20;
constexpr int kBindAttempts = 16;  // for port 0: the number that UDP got may be taken for TCP
constexpr std::string_view kKey = "streaming.native";
// One more byte than allowed: longer datagrams are detected.
constexpr std::size_t kLongestRequest = kMaxDatagram + 1;

/// The data of one profile: list of bodies and frames, each encoded once for all its clients.
class ProfileStream final {
 public:
  ProfileStream(std::uint64_t session, GrantedProfile granted, const SceneModel& model)
      : session_(session), granted_(std::move(granted)), encoder_(session, granted_) {
    use(model);
  }

  [[nodiscard]] std::uint32_t number() const { return granted_.number; }
  [[nodiscard]] const Profile& profile() const { return granted_.profile; }
  void use(const SceneModel& model) {
    chosen_ = chosen_bodies(granted_.profile, model);
    SceneModel own{model.generation, {}};
    for (const auto place : chosen_) own.bodies.push_back(model.bodies[place]);
    model_datagrams_ = encode_model(session_, own, granted_.number);
  }
  [[nodiscard]] std::span<const Datagram> model() const { return model_datagrams_; }
  /// @return empty when the profile skips the frame; valid until the next call
  [[nodiscard]] std::span<const std::span<const std::byte>> encode(const SceneFrame& frame) {
    const std::uint64_t step = step_of(granted_.profile, frame.rate_hz);
    if (frame.number % step != 0) return {};
    return encoder_.encode(frame, chosen_, step);
  }

 private:
  std::uint64_t session_;
  GrantedProfile granted_;
  FrameEncoder encoder_;
  std::vector<std::uint32_t> chosen_;
  std::vector<Datagram> model_datagrams_;
};

class NativeServer final : public Streamer {
 public:
  NativeServer(const ProtocolContext& context, net::UdpServer udp, const NativeConfig& config)
      : Streamer("native"),
        io_(context.io),
        config_(config),
        clock_(context.clock),
        registry_(limits_of(config), net::random_key(),
                  std::max<std::uint64_t>(1, net::random_word())),
        udp_(std::move(udp)) {
    port_ = udp_.port();
    streams_.push_back(
        std::make_unique<ProfileStream>(registry_.session(), GrantedProfile{}, *context.model));
    use(context.model);
  }
  ~NativeServer() override { NativeServer::stop(); }

  void listen() {
    udp_.start([this](const auto& request) { answer(request); });
    if (!config_.discovery) return;
    update_discovery(0);
    listen_to_broadcasts();
  }

  [[nodiscard]] Expected<void> join_group() {
    const std::string& by =
        config_.multicast_interface.empty() ? config_.address : config_.multicast_interface;
    const auto interface = net::parse_address(by);
    if (!interface)
      return fail(ErrorCode::kInvalid,
                  "multicast needs an IPv4 address: set streaming.native.address", by);
    if (const auto error = udp_.use_multicast(*interface, config_.multicast_ttl))
      return fail(ErrorCode::kUnavailable,
                  "cannot send multicast by this interface (" + error.message() +
                      "): set streaming.native.multicast_interface to one of this machine's",
                  by);
    group_ = Peer{net::parse_address(config_.multicast_group).value_or(0), config_.multicast_port};
    MulticastGroup offered{{}, group_.port};
    std::copy(group_.address.end() - 4, group_.address.end(), offered.address.begin());
    registry_.offer_multicast(offered);
    return {};
  }

  [[nodiscard]] Expected<void> take_commands(OperatorApi& operator_api, const EventBoard* events) {
    control_.emplace(io_, operator_api, events, clock_);
    return control_->listen({config_.address, port(), kKey});
  }

  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    if (!udp_.is_open()) return;
    if (const auto gone = registry_.expire(clock_.now()); gone > 0)
      log::info("native", std::to_string(gone) + " client(s) timed out and were removed");
    if (frame->model->bodies.size() > kMaxBodies || frame->bodies.size() > kMaxBodies) return;
    if (frame->model->generation != model_->generation) {
      use(frame->model);
      for (auto& subscriber : registry_.subscribers())
        send_model(subscriber.profile, subscriber.peer);
    }
    if (frame->rate_hz != card_rate_hz_) update_discovery(frame->rate_hz);
    if (!registry_.subscribers().empty()) send(*frame);
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    const Instant now = clock_.now();
    for (const auto& subscriber : registry_.subscribers())
      out.push_back(status_of(subscriber, profile_of(subscriber.profile), now));
  }

  void stop() override {
    if (control_) control_->stop();
    for (auto& one : broadcasts_) one.stop();
    if (!udp_.is_open()) return;
    const auto notice =
        encode_notice(registry_.session(), 0, NoticeReason::kShuttingDown, "the server ends");
    for (const auto& subscriber : registry_.subscribers()) udp_.send(notice, subscriber.peer);
    udp_.stop();
  }

 private:
  /// A socket that is bound to one IPv4 address does not receive broadcasts; one for all addresses
  /// does. Loopback and IPv6 have none.
  void listen_to_broadcasts() {
    const auto own = net::parse_address(config_.address);
    if (!own || *own == 0 || Peer{*own, 0}.is_loopback()) return;
    for (const auto& address : net::subnet_broadcasts(*own)) {
      auto opened = net::UdpServer::open(io_, {address, port(), kKey},
                                         {"native", kLongestRequest, /*shared=*/true});
      if (!opened) {
        log::warning("native", "will not be discovered by broadcast to " + address + ": " +
                                   opened.error().text());
        continue;
      }
      broadcasts_.push_back(std::move(*opened));
      broadcasts_.back().start([this](const auto& query) { answer(query); });
    }
  }

  void use(std::shared_ptr<const SceneModel> model) {
    model_ = std::move(model);
    for (const auto& stream : streams_) stream->use(*model_);
    update_discovery(card_rate_hz_);
  }

  void update_discovery(double rate_hz) {
    card_rate_hz_ = rate_hz;
    if (!config_.discovery) return;
    registry_.set_discovery(ServerCard{net::host_name(), FIDUCAP_VERSION,
                                       static_cast<std::uint32_t>(model_->bodies.size()), rate_hz,
                                       port()});
  }

  /// One stream per profile in use, the default one first.
  void follow_profiles() {
    const auto granted = registry_.profiles();
    const auto is_gone = [&](const std::unique_ptr<ProfileStream>& stream) {
      return stream->number() != 0 && std::ranges::none_of(granted, [&](const GrantedProfile& g) {
               return g.number == stream->number();
             });
    };
    std::erase_if(streams_, is_gone);
    for (const auto& one : granted) {
      const bool is_here = std::ranges::any_of(
          streams_, [&](const auto& stream) { return stream->number() == one.number; });
      if (!is_here)
        streams_.push_back(std::make_unique<ProfileStream>(registry_.session(), one, *model_));
    }
  }

  [[nodiscard]] const Profile& profile_of(std::uint32_t number) const {
    for (const auto& granted : registry_.profiles())
      if (granted.number == number) return granted.profile;
    return streams_.front()->profile();  // the default one
  }

  /// Sends every profile's frame to its clients, all in one batch.
  void send(const SceneFrame& frame) {
    follow_profiles();
    const auto subscribers = registry_.subscribers();
    udp_.batch().clear();
    for (auto& one : subscribers) one.datagrams.clear();
    for (const auto& stream : streams_) {
      const bool is_used = std::ranges::any_of(
          subscribers, [&](const auto& one) { return one.profile == stream->number(); });
      if (!is_used) continue;
      const auto datagrams = stream->encode(frame);
      if (!datagrams.empty()) add_to_batch(stream->number(), datagrams);
    }
    udp_.send_batch();
    for (auto& one : subscribers) one.datagrams.settle(udp_.batch());
  }

  void add_to_batch(std::uint32_t profile, std::span<const std::span<const std::byte>> datagrams) {
    const net::DatagramShare* to_group = nullptr;
    for (Subscriber& one : registry_.subscribers()) {
      if (one.profile != profile) continue;
      if (one.multicast && to_group != nullptr) {
        one.datagrams.share(*to_group);
        continue;
      }
      one.datagrams.open(udp_.batch());
      for (const auto& datagram : datagrams) udp_.add(datagram, one.multicast ? group_ : one.peer);
      one.datagrams.close(udp_.batch());
      if (one.multicast) to_group = &one.datagrams;
    }
  }

  void answer(const net::UdpServer::Datagram& request) {
    const Peer& from = request.from;
    const auto reply = registry_.receive(request.bytes, from, model_->generation, clock_.now());
    if (!reply.datagram.empty()) udp_.send(reply.datagram, from);
    if (reply.send_model) {
      follow_profiles();
      send_model(reply.profile, from);
    }
    if (reply.instead_of)
      log::warning("native",
                   net::text_of(*reply.instead_of) +
                       " udp is removed: its address has the most clients or profiles and "
                       "another client needs one");
    if (reply.event == Registry::Event::kNone) return;
    log::info("native", net::text_of(from) + " udp" +
                            (reply.event == Registry::Event::kJoined ? " subscribed" : " left"));
  }

  void send_model(std::uint32_t profile, const Peer& to) {
    for (const auto& stream : streams_) {
      if (stream->number() != profile) continue;
      for (const auto& part : stream->model()) udp_.send(part, to);
    }
  }

  boost::asio::io_context& io_;
  NativeConfig config_;
  const Clock& clock_;
  Registry registry_;
  std::vector<std::unique_ptr<ProfileStream>> streams_;
  Peer group_;
  std::shared_ptr<const SceneModel> model_;
  double card_rate_hz_{0};
  std::optional<ControlServer> control_;
  std::vector<net::UdpServer> broadcasts_;
  net::UdpServer udp_;
};

/// One attempt.
Expected<std::unique_ptr<NativeServer>> open_server(const ProtocolContext& context,
                                                    const NativeConfig& config) {
  auto udp = net::UdpServer::open(
      context.io, {config.address, config.port, kKey},
      {.protocol = "native", .longest = kLongestRequest, .send_buffer_bytes = kSendBuffer});
  if (!udp) return tl::unexpected(udp.error());
  auto server = std::make_unique<NativeServer>(context, std::move(*udp), config);
  if (!config.multicast_group.empty()) {
    if (auto joined = server->join_group(); !joined) return tl::unexpected(joined.error());
  }
  if (config.control && context.operator_api != nullptr) {
    if (auto taken = server->take_commands(*context.operator_api, context.events); !taken)
      return tl::unexpected(taken.error());
  }
  return server;
}

}  // namespace

std::vector<ConfigError> NativeConfig::check() const {
  const auto group = net::parse_address(multicast_group);
  const bool is_group = group && *group >> 28 == 0xe;  // 224.0.0.0 to 239.255.255.255
  return Checker{"streaming.native."}
      .require(net::is_address(address), "address", address,
               "must be an IP address, e.g. 127.0.0.1 or 0.0.0.0")
      .within("max_clients", max_clients, 1, 1024)
      .within("max_clients_per_address", max_clients_per_address, 1, 1024)
      .within("lease_s", lease_s, 0.5, 60)
      .require(multicast_group.empty() || is_group, "multicast_group", multicast_group,
               "must be an IPv4 multicast address, e.g. 239.255.42.16, or empty")
      .require(multicast_group.empty() || multicast_port != 0, "multicast_port",
               std::to_string(multicast_port), "must not be 0")
      .within("multicast_ttl", multicast_ttl, 0, 255)
      .require(multicast_interface.empty() || net::parse_address(multicast_interface),
               "multicast_interface", multicast_interface,
               "must be an IPv4 address of this machine, or empty")
      .errors;
}

ServedProtocol NativeConfig::served() const {
  const ProtocolConventions& conventions = conventions_of("native");
  std::vector<PortUse> ports{{port, true}};
  if (control) ports.push_back({port, false});
  return {"native", enabled, address, std::move(ports), conventions.axes, conventions.when_invalid};
}

StartedStreamer serve(const ProtocolContext& context, const NativeConfig& config) {
  if (const std::size_t bodies = context.model->bodies.size(); bodies > kMaxBodies)
    return fail(ErrorCode::kInvalid, "the native protocol carries at most " +
                                         std::to_string(kMaxBodies) + " bodies, the scene has " +
                                         std::to_string(bodies));
  auto server = open_server(context, config);
  for (int i = 1; i < kBindAttempts && !server && config.port == 0; ++i)
    server = open_server(context, config);
  if (!server) return tl::unexpected(server.error());
  (*server)->listen();
  log::info("native", "serves Fiducap clients on " + config.address + ":" +
                          std::to_string((*server)->port()) +
                          (config.control ? " (UDP; control by TCP)" : " (UDP)"));
  return std::move(*server);
}

}  // namespace fiducap::native
