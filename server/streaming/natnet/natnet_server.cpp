#include <optional>
#include <utility>
#include <vector>

#include "base/log.hpp"
#include "streaming/natnet/codec.hpp"
#include "streaming/natnet/commands.hpp"
#include "streaming/natnet/conversation.hpp"
#include "streaming/natnet/group_sender.hpp"
#include "streaming/natnet/natnet.hpp"
#include "streaming/net/interfaces.hpp"
#include "streaming/net/udp_server.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::size_t kLongestDatagram = 65536;
// 1000 bodies for 64 clients are 2.5 MB; the kernel limits it to net.core.wmem_max.
constexpr int kSendBuffer = 16 << 20;
constexpr std::string_view kKey = "streaming.natnet";

/// Further addresses that receive broadcast DISCOVERY when `address` is that of one interface:
/// 255.255.255.255 and its subnet's broadcast address. Empty for 0.0.0.0.
std::vector<std::string> broadcast_addresses(const std::string& address) {
  const auto own = parse_address(address);
  if (!own || *own == 0) return {};
  if (Peer{*own, 0}.is_loopback()) return {"127.255.255.255", "255.255.255.255"};
  std::vector<std::string> all = net::subnet_broadcasts(*own);
  all.insert(all.begin(), "255.255.255.255");
  return all;
}

Expected<net::UdpServer> open_command_port(boost::asio::io_context& io,
                                           const net::BindTarget& target) {
  net::UdpOptions options{"natnet", kLongestDatagram};
  options.fragments = true;  // a MODELDEF longer than the MTU
  options.reports_refusals = true;
  return net::UdpServer::open(io, target, options);
}

/// The socket for unicast frames; the vendor's library ignores frames from a command port.
Expected<net::UdpServer> open_frame_port(boost::asio::io_context& io, const NatNetConfig& config) {
  net::UdpOptions options{"natnet"};
  options.fragments = true;
  options.reports_refusals = true;
  options.send_buffer_bytes = kSendBuffer;
  return net::UdpServer::open(io, {config.address, 0, kKey}, options);
}

std::string groups_text(const GroupSender& sender) {
  std::string text;
  for (const Peer& group : sender.groups()) text += (text.empty() ? "" : " and ") + text_of(group);
  return text;
}

class NatNetServer final : public NatNetStreamer {
 public:
  NatNetServer(net::UdpServer frames, GroupSender groups, Conversation conversation,
               const Clock& clock)
      : clock_(clock),
        conversation_(std::move(conversation)),
        groups_(std::move(groups)),
        frames_(std::move(frames)) {
    addressees_.reserve(conversation_.subscribers().size());
  }

  /// Opens the command ports of both channels, and sockets for broadcasts.
  [[nodiscard]] Expected<void> listen(boost::asio::io_context& io, const NatNetConfig& config);
  [[nodiscard]] std::string_view protocol() const override { return "natnet"; }
  [[nodiscard]] std::uint16_t port() const override { return commands_ ? commands_->port() : 0; }
  [[nodiscard]] std::uint16_t unicast_port() const override {
    return unicast_ ? unicast_->port() : 0;
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame) override;
  void append_clients(std::vector<ClientStatus>& out) const override;
  void stop() override;

 private:
  Expected<void> listen(boost::asio::io_context& io, const net::BindTarget& target, Channel channel,
                        std::optional<net::UdpServer>& commands);
  void answer(const net::UdpServer::Datagram& request, Channel channel, net::UdpServer& from);
  void remove_gone_clients(Instant now);
  void read_refusals(net::UdpServer& commands, Instant now);
  void count_sent();

  const Clock& clock_;
  Conversation conversation_;
  GroupSender groups_;
  std::vector<std::size_t> addressees_;  ///< Places of subscribers in the current batch.
  std::optional<Instant> first_frame_at_;
  bool stopped_{false};
  net::UdpServer frames_;
  std::optional<net::UdpServer> commands_;
  std::optional<net::UdpServer> unicast_;  ///< Replies without a group.
  std::vector<net::UdpServer> broadcasts_;
};

Expected<void> NatNetServer::listen(boost::asio::io_context& io, const NatNetConfig& config) {
  Expected<void> done =
      listen(io, {config.address, config.port, kKey},
             config.multicast ? Channel::kMulticast : Channel::kUnicast, commands_);
  if (done && config.multicast && config.unicast) {
    const std::uint16_t second = config.port == 0 ? std::uint16_t{0} : config.unicast_port;
    done = listen(io, {config.address, second, kKey, "unicast_port"}, Channel::kUnicast, unicast_);
  }
  if (done) conversation_.set_ports(port(), unicast_port());
  return done;
}

Expected<void> NatNetServer::listen(boost::asio::io_context& io, const net::BindTarget& target,
                                    Channel channel, std::optional<net::UdpServer>& commands) {
  auto opened = open_command_port(io, target);
  if (!opened) return tl::unexpected(opened.error());
  commands.emplace(std::move(*opened));
  // Replies are sent from the port of their channel, also to a broadcast.
  const auto handler = [this, channel, &commands](const net::UdpServer::Datagram& request) {
    answer(request, channel, *commands);
  };
  commands->start(handler);
  const bool own_only = Peer{parse_address(target.address).value_or(0), 0}.is_loopback();
  for (const auto& address : broadcast_addresses(target.address)) {
    // Optional: without discovery by broadcast the address is configured in the client.
    auto heard = open_command_port(io, {address, commands->port(), kKey});
    if (!heard) continue;
    broadcasts_.push_back(std::move(*heard));
    // Only clients of this machine are served.
    if (!own_only) {
      broadcasts_.back().start(handler);
      continue;
    }
    broadcasts_.back().start([handler](const net::UdpServer::Datagram& request) {
      // Replies from the served address, not from that of the receiving interface.
      if (net::is_this_machine(request.from)) handler({request.bytes, request.from, 0});
    });
  }
  return {};
}

void NatNetServer::answer(const net::UdpServer::Datagram& request, Channel channel,
                          net::UdpServer& from) {
  const auto answer = conversation_.receive(request.bytes, request.from, channel, clock_.now());
  if (!answer.empty()) from.send(answer, request.from, request.to);
  if (conversation_.asked_for_group() && groups_.add_interface_of(request.to))
    log::info("natnet", net::address_text(request.from) + " asked: frames are sent to " +
                            groups_text(groups_) + " by " + groups_.interfaces_text());
}

void NatNetServer::publish(const std::shared_ptr<const SceneFrame>& frame) {
  if (stopped_) return;
  const Instant now = clock_.now();
  remove_gone_clients(now);
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
  if (groups_.has_groups()) {
    if (!first_frame_at_) first_frame_at_ = now;
    groups_.send(conversation_.multicast_frame(now));
  }
  if (frames_.batch().size() == 0) return;
  frames_.send_batch();
  count_sent();
}

void NatNetServer::read_refusals(net::UdpServer& commands, Instant now) {
  while (const auto peer = commands.next_refused()) conversation_.reply_refused(*peer, now);
}

void NatNetServer::remove_gone_clients(Instant now) {
  if (commands_) read_refusals(*commands_, now);
  if (unicast_) read_refusals(*unicast_, now);
  while (const auto peer = frames_.next_refused()) {
    if (conversation_.remove(*peer))
      log::info("natnet", text_of(*peer) + " is removed: its port is closed");
  }
  if (const auto silent = conversation_.expire(now); silent > 0)
    log::info("natnet", std::to_string(silent) + " client(s) timed out and were removed");
}

void NatNetServer::count_sent() {
  const auto subscribers = conversation_.subscribers();
  for (std::size_t i = 0; i < addressees_.size(); ++i) {
    Subscriber& to = subscribers[addressees_[i]];
    ++(frames_.batch().sent(i) ? to.frames_sent : to.frames_dropped);
  }
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
  const std::string interfaces = groups_.interfaces_text();
  if (!groups_.has_groups() || interfaces.empty()) return;
  out.push_back({"natnet", groups_text(groups_) + " multicast",
                 "by " + interfaces + ", bitstream " + config.bitstream + ", " + axes,
                 groups_.sent(), groups_.dropped(),
                 first_frame_at_ ? to_seconds(now - *first_frame_at_) : 0.0});
}

void NatNetServer::stop() {
  stopped_ = true;
  if (commands_) commands_->stop();
  if (unicast_) unicast_->stop();
  for (auto& one : broadcasts_) one.stop();
}

std::string where_text(const NatNetConfig& config, const NatNetServer& server) {
  const std::string commands = config.address + ":" + std::to_string(server.port()) + " (UDP)";
  if (!config.multicast) return commands + ", to each client";
  std::string text =
      commands + ", to " + config.multicast_group + ":" + std::to_string(config.data_port);
  if (server.unicast_port() == 0) return text;
  return text + " and to each client that keeps alive; port " +
         std::to_string(server.unicast_port()) + " names no group";
}

}  // namespace

Expected<std::unique_ptr<NatNetStreamer>> start_natnet_server(
    boost::asio::io_context& io, const NatNetConfig& config,
    std::shared_ptr<const SceneModel> model, const Clock& clock, OperatorApi* operator_api,
    double rate_hz) {
  if (model->bodies.size() > kMaxBodies)
    return fail(ErrorCode::kInvalid, "NatNet clients take at most " + std::to_string(kMaxBodies) +
                                         " bodies, the scene has " +
                                         std::to_string(model->bodies.size()));
  auto frames = open_frame_port(io, config);
  if (!frames) return tl::unexpected(frames.error());
  auto groups = GroupSender::open(io, config);
  if (!groups) return tl::unexpected(groups.error());
  Conversation conversation(config, std::move(model), operator_api, rate_hz, net::random_word(),
                            net::TrustedNetworks(config.trusted_networks()), clock.now());
  auto server = std::make_unique<NatNetServer>(std::move(*frames), std::move(*groups),
                                               std::move(conversation), clock);
  if (auto listening = server->listen(io, config); !listening)
    return tl::unexpected(listening.error());
  log::info("natnet", "serves NatNet " + fiducap::natnet::text_of(kOldest) + " to " +
                          fiducap::natnet::text_of(kNewest) + " on " + where_text(config, *server));
  return server;
}

}  // namespace fiducap::natnet
