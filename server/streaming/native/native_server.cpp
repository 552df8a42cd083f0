#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "base/log.hpp"
#include "streaming/native/codec.hpp"
#include "streaming/native/control_session.hpp"
#include "streaming/native/frames.hpp"
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

/// Random for each start: tokens cannot be guessed, and clients notice a restart.
Registry make_registry(const NativeConfig& config) {
  return {limits_of(config), net::random_key(), std::max<std::uint64_t>(1, net::random_word())};
}

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
  NativeServer(boost::asio::io_context& io, net::UdpServer udp, const NativeConfig& config,
               const std::shared_ptr<const SceneModel>& model, const Clock& clock)
      : io_(io),
        config_(config),
        clock_(clock),
        registry_(make_registry(config)),
        udp_(std::move(udp)) {
    streams_.push_back(
        std::make_unique<ProfileStream>(registry_.session(), GrantedProfile{}, *model));
    use(model);
  }
  ~NativeServer() override { NativeServer::stop(); }

  void listen() {
    udp_.start([this](const auto& request) { answer(request); });
    if (!config_.discovery) return;
    update_discovery(0);
    listen_to_broadcasts();
  }
  [[nodiscard]] Expected<void> join_group();
  [[nodiscard]] Expected<void> take_commands(OperatorApi& operator_api, const EventBoard* events) {
    control_.emplace(io_, operator_api, events, clock_);
    return control_->listen({config_.address, port(), kKey});
  }

  [[nodiscard]] std::string_view protocol() const override { return "native"; }
  [[nodiscard]] std::uint16_t port() const override { return udp_.port(); }
  void publish(const std::shared_ptr<const SceneFrame>& frame) override;
  void append_clients(std::vector<ClientStatus>& out) const override;
  void stop() override;

 private:
  struct Send {
    std::size_t subscriber;
    std::size_t first;  ///< In the batch.
    std::size_t count;
  };

  void listen_to_broadcasts();
  void use(std::shared_ptr<const SceneModel> model);
  void update_discovery(double rate_hz);
  void follow_profiles();
  [[nodiscard]] const Profile& profile_of(std::uint32_t number) const;
  void send(const SceneFrame& frame);
  void add_to_batch(std::uint32_t profile, std::span<const std::span<const std::byte>> datagrams);
  void answer(const net::UdpServer::Datagram& request);
  void send_model(std::uint32_t profile, const Peer& to);

  boost::asio::io_context& io_;
  NativeConfig config_;
  const Clock& clock_;
  Registry registry_;
  std::vector<std::unique_ptr<ProfileStream>> streams_;
  std::vector<Send> sends_;
  Peer group_;
  std::shared_ptr<const SceneModel> model_;
  double card_rate_hz_{0};
  std::optional<ControlServer> control_;
  std::vector<net::UdpServer> broadcasts_;
  net::UdpServer udp_;
};

Expected<void> NativeServer::join_group() {
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

/// A socket that is bound to one IPv4 address does not receive broadcasts; one for all addresses
/// does. Loopback and IPv6 have none.
void NativeServer::listen_to_broadcasts() {
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

void NativeServer::publish(const std::shared_ptr<const SceneFrame>& frame) {
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

void NativeServer::append_clients(std::vector<ClientStatus>& out) const {
  const Instant now = clock_.now();
  for (const auto& subscriber : registry_.subscribers())
    out.push_back(status_of(subscriber, profile_of(subscriber.profile), now));
}

void NativeServer::stop() {
  if (control_) control_->stop();
  for (auto& one : broadcasts_) one.stop();
  if (!udp_.is_open()) return;
  const auto notice =
      encode_notice(registry_.session(), 0, NoticeReason::kShuttingDown, "the server ends");
  for (const auto& subscriber : registry_.subscribers()) udp_.send(notice, subscriber.peer);
  udp_.stop();
}

void NativeServer::use(std::shared_ptr<const SceneModel> model) {
  model_ = std::move(model);
  for (const auto& stream : streams_) stream->use(*model_);
  update_discovery(card_rate_hz_);
}

void NativeServer::update_discovery(double rate_hz) {
  card_rate_hz_ = rate_hz;
  if (!config_.discovery) return;
  registry_.set_discovery(ServerCard{net::host_name(), FIDUCAP_VERSION,
                                     static_cast<std::uint32_t>(model_->bodies.size()), rate_hz,
                                     port()});
}

/// One stream per profile in use, the default one first.
void NativeServer::follow_profiles() {
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

const Profile& NativeServer::profile_of(std::uint32_t number) const {
  for (const auto& granted : registry_.profiles())
    if (granted.number == number) return granted.profile;
  return streams_.front()->profile();  // the default one
}

/// Sends every profile's frame to its clients, all in one batch.
void NativeServer::send(const SceneFrame& frame) {
  follow_profiles();
  const auto subscribers = registry_.subscribers();
  sends_.clear();
  udp_.batch().clear();
  for (const auto& stream : streams_) {
    const bool is_used = std::ranges::any_of(
        subscribers, [&](const auto& one) { return one.profile == stream->number(); });
    if (!is_used) continue;
    const auto datagrams = stream->encode(frame);
    if (!datagrams.empty()) add_to_batch(stream->number(), datagrams);
  }
  udp_.send_batch();
  for (const auto& one : sends_) {
    bool sent = true;
    for (std::size_t i = one.first; i < one.first + one.count; ++i)
      sent = sent && udp_.batch().sent(i);
    auto& subscriber = registry_.subscribers()[one.subscriber];
    ++(sent ? subscriber.frames_sent : subscriber.frames_dropped);
  }
}

void NativeServer::add_to_batch(std::uint32_t profile,
                                std::span<const std::span<const std::byte>> datagrams) {
  const auto subscribers = registry_.subscribers();
  std::optional<std::size_t> to_group;  // its first datagram in the batch
  for (std::size_t i = 0; i < subscribers.size(); ++i) {
    if (subscribers[i].profile != profile) continue;
    std::size_t first = udp_.batch().size();
    if (subscribers[i].multicast) {
      if (!to_group) {
        to_group = first;
        for (const auto& datagram : datagrams) udp_.add(datagram, group_);
      }
      first = *to_group;
    } else {
      for (const auto& datagram : datagrams) udp_.add(datagram, subscribers[i].peer);
    }
    sends_.push_back({i, first, datagrams.size()});
  }
}

void NativeServer::send_model(std::uint32_t profile, const Peer& to) {
  for (const auto& stream : streams_) {
    if (stream->number() != profile) continue;
    for (const auto& part : stream->model()) udp_.send(part, to);
  }
}

void NativeServer::answer(const net::UdpServer::Datagram& request) {
  const Peer& from = request.from;
  const auto reply = registry_.receive(request.bytes, from, model_->generation, clock_.now());
  if (!reply.datagram.empty()) udp_.send(reply.datagram, from);
  if (reply.send_model) {
    follow_profiles();
    send_model(reply.profile, from);
  }
  if (reply.instead_of)
    log::warning("native", net::text_of(*reply.instead_of) +
                               " udp is removed: its address has the most clients or profiles and "
                               "another client needs one");
  if (reply.event == Registry::Event::kNone) return;
  log::info("native", net::text_of(from) + " udp" +
                          (reply.event == Registry::Event::kJoined ? " subscribed" : " left"));
}

/// One attempt.
Expected<std::unique_ptr<NativeServer>> open_server(boost::asio::io_context& io,
                                                    const NativeConfig& config,
                                                    const std::shared_ptr<const SceneModel>& model,
                                                    const Clock& clock, OperatorApi* operator_api,
                                                    const EventBoard* events) {
  net::UdpOptions options{"native", kLongestRequest};
  options.send_buffer_bytes = kSendBuffer;
  auto udp = net::UdpServer::open(io, {config.address, config.port, kKey}, options);
  if (!udp) return tl::unexpected(udp.error());
  auto server = std::make_unique<NativeServer>(io, std::move(*udp), config, model, clock);
  if (!config.multicast_group.empty()) {
    if (auto joined = server->join_group(); !joined) return tl::unexpected(joined.error());
  }
  if (config.control && operator_api != nullptr) {
    if (auto taken = server->take_commands(*operator_api, events); !taken)
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
  return {"native", enabled, address, {{port, true}}, conventions.axes, conventions.when_invalid};
}

StartedStreamer start_native_server(boost::asio::io_context& io, const NativeConfig& config,
                                    std::shared_ptr<const SceneModel> model, const Clock& clock,
                                    OperatorApi* operator_api, const EventBoard* events) {
  if (model->bodies.size() > kMaxBodies)
    return fail(ErrorCode::kInvalid, "the native protocol carries at most " +
                                         std::to_string(kMaxBodies) + " bodies, the scene has " +
                                         std::to_string(model->bodies.size()));
  auto server = open_server(io, config, model, clock, operator_api, events);
  for (int i = 1; i < kBindAttempts && !server && config.port == 0; ++i)
    server = open_server(io, config, model, clock, operator_api, events);
  if (!server) return tl::unexpected(server.error());
  (*server)->listen();
  log::info("native", "serves Fiducap clients on " + config.address + ":" +
                          std::to_string((*server)->port()) +
                          (config.control ? " (UDP; control by TCP)" : " (UDP)"));
  return std::move(*server);
}

}  // namespace fiducap::native
