#include "streaming/natnet/natnet_server.hpp"

#include <optional>
#include <utility>
#include <vector>

#include "base/log.hpp"
#include "streaming/natnet/conversation.hpp"
#include "streaming/natnet/wire.hpp"
#include "streaming/net/interfaces.hpp"
#include "streaming/net/udp_server.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::size_t kLongestDatagram = 65536;
// 1000 bodies for 64 clients at once are 2.5 MB; the kernel grants what net.core.wmem_max allows.
constexpr int kSendBuffer = 16 << 20;
constexpr std::string_view kKey = "streaming.natnet";

/// Where else DISCOVERY by broadcast arrives when only `address` is listened on: its subnet's
/// broadcast address, and 255.255.255.255 unless it is the loopback. Empty for 0.0.0.0, which hears
/// everything.
std::vector<std::string> broadcast_addresses(const std::string& address) {
  const auto own = parse_address(address);
  if (!own || *own == 0) return {};
  if (Peer{*own, 0}.is_loopback()) return {"127.255.255.255"};
  std::vector<std::string> all = net::subnet_broadcasts(*own);
  all.insert(all.begin(), "255.255.255.255");
  return all;
}

/// The address of the card that multicast frames leave by: the one configured, or the one listened
/// on, or the only one.
/// @return Error naming the choices when there are several: guessing wrong looks like "nothing
/// arrives"
Expected<std::uint32_t> multicast_interface(const NatNetConfig& config) {
  constexpr std::uint32_t kLoopback = 0x7f000001;
  const auto named = parse_address(config.multicast_interface.empty() ? config.address
                                                                      : config.multicast_interface);
  if (named && *named != 0) return *named;
  std::vector<net::Card> able = net::network_cards();
  std::erase_if(able, [](const net::Card& card) { return !card.multicast; });
  if (able.empty()) return kLoopback;
  if (able.size() == 1) return able.front().address;
  std::string choices;
  for (const net::Card& card : able) {
    choices += (choices.empty() ? "" : ", ") + net::address_text({card.address, 0}) + " (" +
               card.name + ")";
  }
  return fail(
      ErrorCode::kInvalid,
      "this machine has several network cards; set it to the one the clients are on: " + choices,
      "streaming.natnet.multicast_interface");
}

Expected<net::UdpServer> open_command_port(boost::asio::io_context& io,
                                           const net::BindTarget& target) {
  net::UdpOptions options{"natnet", kLongestDatagram};
  options.fragments = true;  // a MODELDEF longer than the MTU
  return net::UdpServer::open(io, target, options);
}

/// The socket that frames leave by. Never a command port: the vendor's library ignores unicast
/// frames that come from there.
Expected<net::UdpServer> open_frame_port(boost::asio::io_context& io, const NatNetConfig& config) {
  net::UdpOptions options{"natnet"};
  options.fragments = true;
  options.reports_refusals = true;
  options.send_buffer_bytes = kSendBuffer;
  auto port = net::UdpServer::open(io, {config.address, 0, kKey}, options);
  if (!port || !config.multicast) return port;
  const auto card = multicast_interface(config);
  if (!card) return tl::unexpected(card.error());
  if (const auto error = port->use_multicast(*card, config.multicast_ttl)) {
    return fail(ErrorCode::kUnavailable,
                "cannot send multicast by this interface (" + error.message() +
                    "); set it to the address of one that can (`ip maddr` lists them)",
                "streaming.natnet.multicast_interface");
  }
  return port;
}

class NatNetServer final : public NatNetStreamer {
 public:
  NatNetServer(net::UdpServer frames, Conversation conversation, const NatNetConfig& config,
               const Clock& clock)
      : clock_(clock),
        conversation_(std::move(conversation)),
        group_(config.multicast
                   ? parse_peer(config.multicast_group + ":" + std::to_string(config.data_port))
                   : std::nullopt),
        frames_(std::move(frames)) {
    addressees_.reserve(conversation_.subscribers().size());
  }

  /// The command ports of both channels, and sockets that only hear broadcasts.
  [[nodiscard]] Expected<void> listen(boost::asio::io_context& io, const NatNetConfig& config);
  [[nodiscard]] std::string_view protocol() const override { return "natnet"; }
  [[nodiscard]] std::uint16_t port() const override { return port(Channel::kUnicast); }
  [[nodiscard]] std::uint16_t multicast_command_port() const override {
    return port(Channel::kMulticast);
  }
  [[nodiscard]] std::uint16_t port(Channel channel) const {
    const auto& port = command_port(channel);
    return port ? port->port() : std::uint16_t{0};
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame) override;
  void append_clients(std::vector<ClientStatus>& out) const override;
  void stop() override;

 private:
  [[nodiscard]] const std::optional<net::UdpServer>& command_port(Channel channel) const {
    return channel == Channel::kUnicast ? unicast_ : multicast_;
  }
  Expected<void> listen(boost::asio::io_context& io, const net::BindTarget& target, Channel channel,
                        std::optional<net::UdpServer>& commands);
  void answer(const net::UdpServer::Datagram& request, Channel channel, net::UdpServer& from);
  void forget_the_gone(Instant now);
  void count_sent();

  const Clock& clock_;
  Conversation conversation_;
  std::optional<Peer> group_;
  std::vector<std::size_t> addressees_;  ///< Places of subscribers in the batch under way.
  std::uint64_t group_sent_{0};
  std::uint64_t group_dropped_{0};
  std::optional<Instant> group_since_;
  bool stopped_{false};
  net::UdpServer frames_;
  std::optional<net::UdpServer> unicast_;
  std::optional<net::UdpServer> multicast_;
  std::vector<net::UdpServer> broadcasts_;
};

Expected<void> NatNetServer::listen(boost::asio::io_context& io, const NatNetConfig& config) {
  Expected<void> done;
  if (config.unicast)
    done = listen(io, {config.address, config.port, kKey}, Channel::kUnicast, unicast_);
  if (done && config.multicast) {
    done =
        listen(io, {config.address, config.multicast_command_port, kKey, "multicast_command_port"},
               Channel::kMulticast, multicast_);
  }
  if (done) conversation_.set_ports(port(), multicast_command_port());
  return done;
}

Expected<void> NatNetServer::listen(boost::asio::io_context& io, const net::BindTarget& target,
                                    Channel channel, std::optional<net::UdpServer>& commands) {
  auto opened = open_command_port(io, target);
  if (!opened) return tl::unexpected(opened.error());
  commands.emplace(std::move(*opened));
  // Answers leave from the port of their channel, also when the question came by broadcast.
  const auto handler = [this, channel, &commands](const net::UdpServer::Datagram& request) {
    answer(request, channel, *commands);
  };
  commands->start(handler);
  for (const auto& address : broadcast_addresses(target.address)) {
    // Discovery by broadcast is a comfort; without it a client is told the address.
    auto heard = open_command_port(io, {address, commands->port(), kKey});
    if (!heard) continue;
    broadcasts_.push_back(std::move(*heard));
    broadcasts_.back().start(handler);
  }
  return {};
}

void NatNetServer::answer(const net::UdpServer::Datagram& request, Channel channel,
                          net::UdpServer& from) {
  const auto answer = conversation_.receive(request.bytes, request.from, channel, clock_.now());
  if (!answer.empty()) from.send(answer, request.from, request.to);
}

void NatNetServer::publish(const std::shared_ptr<const SceneFrame>& frame) {
  if (stopped_) return;
  const Instant now = clock_.now();
  forget_the_gone(now);
  conversation_.take(frame, now);
  frames_.batch().clear();
  addressees_.clear();
  const auto subscribers = conversation_.subscribers();
  for (std::size_t i = 0; i < subscribers.size(); ++i) {
    const auto bytes = conversation_.frame_for(subscribers[i], now);
    if (bytes.empty()) continue;
    frames_.add(bytes, subscribers[i].peer);
    addressees_.push_back(i);
  }
  if (group_) {
    if (!group_since_) group_since_ = now;
    frames_.add(conversation_.multicast_frame(now), *group_);
  }
  if (frames_.batch().size() == 0) return;
  frames_.send_batch();
  count_sent();
}

void NatNetServer::forget_the_gone(Instant now) {
  while (const auto peer = frames_.next_refused()) {
    if (conversation_.gone(*peer))
      log::info("natnet", text_of(*peer) + " is gone: its port is closed");
  }
  if (const auto silent = conversation_.expire(now); silent > 0) {
    log::info("natnet", std::to_string(silent) + " client(s) fell silent and were forgotten");
  }
}

void NatNetServer::count_sent() {
  const auto subscribers = conversation_.subscribers();
  for (std::size_t i = 0; i < addressees_.size(); ++i) {
    Subscriber& to = subscribers[addressees_[i]];
    ++(frames_.batch().sent(i) ? to.frames_sent : to.frames_dropped);
  }
  if (group_) ++(frames_.batch().sent(addressees_.size()) ? group_sent_ : group_dropped_);
}

void NatNetServer::append_clients(std::vector<ClientStatus>& out) const {
  const Instant now = clock_.now();
  const auto& config = conversation_.server().config;
  const std::string axes = std::string(name_of(config.up)) + " m";
  for (const auto& one : conversation_.subscribers()) {
    std::string detail = "bitstream " + fiducap::natnet::text_of(one.version) + ", " + axes;
    if (!one.name.empty()) detail = one.name + ", " + detail;
    if (!one.selection.is_everything()) detail += ", some bodies";
    out.push_back({"natnet", text_of(one.peer) + " udp", std::move(detail), one.frames_sent,
                   one.frames_dropped, to_seconds(now - one.since)});
  }
  if (!group_) return;
  out.push_back({"natnet", text_of(*group_) + " multicast",
                 "bitstream " + config.bitstream + ", " + axes, group_sent_, group_dropped_,
                 group_since_ ? to_seconds(now - *group_since_) : 0.0});
}

void NatNetServer::stop() {
  stopped_ = true;
  if (unicast_) unicast_->stop();
  if (multicast_) multicast_->stop();
  for (auto& one : broadcasts_) one.stop();
}

std::string where_text(const NatNetConfig& config, const NatNetServer& server) {
  const auto command_port = [&](Channel channel) {
    return config.address + ":" + std::to_string(server.port(channel)) + " (UDP, ";
  };
  std::string text;
  if (config.unicast) text = command_port(Channel::kUnicast) + "unicast)";
  if (!config.multicast) return text;
  return text + (config.unicast ? " and on " : "") + command_port(Channel::kMulticast) +
         "multicast to " + config.multicast_group + ":" + std::to_string(config.data_port) + ")";
}

}  // namespace

Expected<std::unique_ptr<NatNetStreamer>> start_natnet_server(
    boost::asio::io_context& io, const NatNetConfig& config,
    std::shared_ptr<const SceneModel> model, const Clock& clock, OperatorDesk* desk,
    double rate_hz) {
  if (model->bodies.size() > kMaxBodies) {
    return fail(ErrorCode::kInvalid, "NatNet clients take at most " + std::to_string(kMaxBodies) +
                                         " bodies, the scene has " +
                                         std::to_string(model->bodies.size()));
  }
  auto frames = open_frame_port(io, config);
  if (!frames) return tl::unexpected(frames.error());
  Conversation conversation(config, std::move(model), desk, rate_hz, net::random_word(),
                            net::TrustedNetworks(config.trusted_networks()), clock.now());
  auto server =
      std::make_unique<NatNetServer>(std::move(*frames), std::move(conversation), config, clock);
  if (auto listening = server->listen(io, config); !listening) {
    return tl::unexpected(listening.error());
  }
  log::info("natnet", "serves NatNet " + fiducap::natnet::text_of(kOldest) + " to " +
                          fiducap::natnet::text_of(kNewest) + " on " + where_text(config, *server));
  return server;
}

}  // namespace fiducap::natnet
