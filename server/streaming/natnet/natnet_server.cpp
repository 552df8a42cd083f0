#include <algorithm>
#include <utility>

#include "base/log.hpp"
#include "streaming/natnet/commands.hpp"
#include "streaming/natnet/conversation.hpp"
#include "streaming/natnet/natnet.hpp"
#include "streaming/net/interfaces.hpp"
#include "streaming/net/udp_server.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::size_t kLongestDatagram = 65536;
// 1000 bodies for 64 clients are 2.5 MB; the kernel limits it to net.core.wmem_max.
constexpr int kSendBuffer = 16 << 20;
constexpr std::string_view kKey = "streaming.natnet";

bool is_own_machine(std::uint32_t address) { return Peer{address, 0}.is_loopback(); }

/// Further addresses that receive broadcast DISCOVERY when `address` is that of one interface:
/// 255.255.255.255 and its subnet's broadcast address. Empty for 0.0.0.0.
std::vector<std::string> broadcast_addresses(const std::string& address) {
  const auto own = parse_address(address);
  if (!own || *own == 0) return {};
  if (is_own_machine(*own)) return {"127.255.255.255", "255.255.255.255"};
  std::vector<std::string> all = net::subnet_broadcasts(*own);
  all.insert(all.begin(), "255.255.255.255");
  return all;
}

// With fragments: a MODELDEF may be longer than the MTU.
constexpr net::UdpOptions kCommandPort{
    .protocol = "natnet", .longest = kLongestDatagram, .fragments = true, .reports_refusals = true};
/// For unicast frames, never from a command port. Shared with programs that listen to the group.
constexpr net::UdpOptions kFramePort{.protocol = "natnet",
                                     .shared = true,
                                     .fragments = true,
                                     .reports_refusals = true,
                                     .send_buffer_bytes = kSendBuffer};
constexpr net::UdpOptions kGroupPort{
    .protocol = "natnet", .fragments = true, .send_buffer_bytes = 4 << 20};

constexpr std::uint32_t kOwnMachine = 0x7f000001;

/// The interface in use from the start; 0: none.
std::uint32_t first_interface(const NatNetConfig& config) {
  if (!config.multicast_interface.empty())
    return parse_address(config.multicast_interface).value_or(0);
  const std::uint32_t own = parse_address(config.address).value_or(0);
  if (own == 0) return kOwnMachine;
  // Configured targets, also groups, get frames without a request.
  const std::size_t unasked = config.groups().size() - (config.multicast ? 1 : 0);
  return is_own_machine(own) || unasked > 0 ? own : 0;
}

/// Sends frames to the configured multicast groups, by the interfaces of the clients.
///
/// `multicast_interface` selects the only interface. Otherwise the loopback is used from the start,
/// and any other interface once a client asked there: networks without clients get no frames.
///
/// Also joins the groups on each interface, so that clients of this machine receive them on any of
/// them. The loopback is silent once another interface is used, so that frames come once.
class GroupSender final {
 public:
  /// @return Error with the remedy when a required interface cannot send multicast
  [[nodiscard]] static Expected<GroupSender> open(boost::asio::io_context& io,
                                                  const NatNetConfig& config) {
    GroupSender sender(io, config);
    const std::uint32_t first = first_interface(config);
    if (!sender.has_groups() || first == 0) return sender;
    if (auto added = sender.add(first); !added) return tl::unexpected(added.error());
    return sender;
  }

  /// A client asked at this IPv4 address of ours. @return its interface is used from now on
  bool add_interface_of(std::uint32_t own) {
    if (!config_.multicast || !config_.multicast_interface.empty() || own == 0) return false;
    const std::uint32_t interface = is_own_machine(own) ? kOwnMachine : own;
    const auto known = [&](const Interface& one) { return one.address == interface; };
    if (std::ranges::any_of(interfaces_, known)) return false;
    const bool failed = std::find(asked_.begin(), asked_.end(), interface) != asked_.end();
    if (failed || asked_.size() == kMostInterfaces) return false;
    asked_.push_back(interface);
    if (const auto added = add(interface); !added) {
      log::warning("natnet", added.error().text());
      return false;
    }
    return true;
  }

  /// To every group by every interface.
  void send(std::span<const std::byte> frame) {
    if (frame.empty()) return;
    for (Interface& interface : interfaces_) {
      if (is_silent(interface)) continue;
      net::DatagramBatch& batch = interface.port.batch();
      batch.clear();
      counts_.open(batch);
      for (const Peer& group : groups_) interface.port.add(frame, group);
      counts_.close(batch);
      interface.port.send_batch();
      counts_.settle(batch);
    }
  }

  [[nodiscard]] bool has_groups() const { return !groups_.empty(); }
  [[nodiscard]] const std::vector<Peer>& groups() const { return groups_; }
  [[nodiscard]] const net::DatagramShare& counts() const { return counts_; }

  /// Addresses of the interfaces in use, e.g. `127.0.0.1, 10.0.0.5`; empty: none yet.
  [[nodiscard]] std::string interfaces_text() const {
    std::string text;
    for (const Interface& interface : interfaces_) {
      if (is_silent(interface)) continue;
      text += (text.empty() ? "" : ", ") + net::address_text({interface.address, 0});
    }
    return text;
  }

 private:
  struct Interface {
    std::uint32_t address{};
    net::UdpServer port;
  };
  static constexpr std::size_t kMostInterfaces = 8;

  GroupSender(boost::asio::io_context& io, const NatNetConfig& config)
      : io_(&io), config_(config), groups_(config.groups()) {}

  Expected<void> add(std::uint32_t address) {
    // From an address with a command port: some clients send requests to the sender of the frames.
    const bool anywhere = parse_address(config_.address).value_or(0) == 0;
    const std::string from = anywhere ? net::address_text({address, 0}) : config_.address;
    auto port = net::UdpServer::open(*io_, {from, 0, kKey}, kGroupPort);
    if (!port) return tl::unexpected(port.error());
    if (const auto error = port->use_multicast(address, config_.multicast_ttl))
      return fail(
          ErrorCode::kUnavailable,
          "cannot send multicast by " + net::address_text({address, 0}) + " (" + error.message() +
              "); set it to the address of an interface that can (`ip maddr` lists them), or "
              "streaming.natnet.multicast: false",
          "streaming.natnet.multicast_interface");
    for (const Peer& group : groups_) port->join(group, address);
    interfaces_.push_back({address, std::move(*port)});
    return {};
  }

  [[nodiscard]] bool is_silent(const Interface& interface) const {
    return is_own_machine(interface.address) && interfaces_.size() > 1;
  }

  boost::asio::io_context* io_;
  NatNetConfig config_;
  std::vector<Peer> groups_;
  std::vector<Interface> interfaces_;
  std::vector<std::uint32_t> asked_;  ///< Also of interfaces that could not be opened.
  net::DatagramShare counts_;
};

std::string groups_text(const GroupSender& sender) {
  std::string text;
  for (const Peer& group : sender.groups()) text += (text.empty() ? "" : " and ") + text_of(group);
  return text;
}

/// The sockets of unicast frames. They leave from the data port for other machines, as from the
/// commercial server, and for libraries that take no others; else from any port, because a client
/// of this machine may need the data port for itself. It is open only while a client needs it.
class FramePorts final {
 public:
  FramePorts(boost::asio::io_context& io, const NatNetConfig& config, net::UdpServer any)
      : io_(&io), address_(config.address), number_(config.data_port), any_(std::move(any)) {}

  void begin(std::span<Subscriber> clients, Instant now) {
    any_.batch().clear();
    if (data_) data_->batch().clear();
    bool wanted = false;
    for (Subscriber& one : clients) {
      if (!one.is_local) one.is_local = net::is_this_machine(one.peer);
      wanted = wanted || needs_data_port(one);
    }
    if (!wanted) data_.reset(), tried_at_.reset();
    if (wanted && !data_ && (!tried_at_ || now - *tried_at_ >= kRetry)) open(now);
  }
  [[nodiscard]] net::UdpServer& port_for(const Subscriber& one) {
    return data_ && needs_data_port(one) ? *data_ : any_;
  }
  void send() {
    any_.send_batch();
    if (data_) data_->send_batch();
  }
  [[nodiscard]] std::optional<Peer> next_refused() {
    if (const auto peer = any_.next_refused()) return peer;
    return data_ ? data_->next_refused() : std::nullopt;
  }

 private:
  static constexpr Duration kRetry = std::chrono::seconds(5);

  [[nodiscard]] bool needs_data_port(const Subscriber& one) const {
    return number_ != 0 && (!one.is_local.value_or(false) || one.library >= kNeedsDataPort);
  }
  void open(Instant now) {
    tried_at_ = now;
    auto opened = net::UdpServer::open(*io_, {address_, number_, kKey, "data_port"}, kFramePort);
    if (opened) {
      data_.emplace(std::move(*opened));
    } else if (!std::exchange(warned_, true)) {
      log::warning("natnet",
                   "frames leave from another port, from which libraries from 4.2 on may not take "
                   "them: " +
                       opened.error().text());
    }
  }

  boost::asio::io_context* io_;
  std::string address_;
  std::uint16_t number_;
  net::UdpServer any_;
  std::optional<net::UdpServer> data_;
  std::optional<Instant> tried_at_;
  bool warned_{false};
};

class NatNetServer final : public Streamer {
 public:
  NatNetServer(FramePorts frames, GroupSender groups, Conversation conversation, const Clock& clock)
      : Streamer("natnet"),
        clock_(clock),
        conversation_(std::move(conversation)),
        groups_(std::move(groups)),
        frames_(std::move(frames)) {}

  /// Opens the command ports of both channels, and sockets for broadcasts.
  [[nodiscard]] Expected<void> listen(boost::asio::io_context& io, const NatNetConfig& config) {
    Expected<void> done =
        listen(io, {config.address, config.port, kKey},
               config.multicast ? Channel::kMulticast : Channel::kUnicast, commands_);
    if (done && config.multicast && config.unicast) {
      const std::uint16_t second = config.port == 0 ? std::uint16_t{0} : config.unicast_port;
      done =
          listen(io, {config.address, second, kKey, "unicast_port"}, Channel::kUnicast, unicast_);
    }
    port_ = commands_ ? commands_->port() : 0;
    second_port_ = unicast_ ? unicast_->port() : 0;
    if (done) conversation_.set_ports(port(), second_port());
    return done;
  }

  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    if (stopped_) return;
    const Instant now = clock_.now();
    remove_gone_clients(now);
    conversation_.take(frame, now);
    frames_.begin(conversation_.subscribers(), now);
    for (Subscriber& one : conversation_.subscribers()) {
      const auto bytes = conversation_.frame_for(one, now);
      net::UdpServer& port = frames_.port_for(one);
      one.datagrams.open(port.batch());
      if (!bytes.empty()) port.add(bytes, one.peer);
      one.datagrams.close(port.batch());
    }
    if (groups_.has_groups()) {
      if (!first_frame_at_) first_frame_at_ = now;
      groups_.send(conversation_.multicast_frame(now));
    }
    frames_.send();
    for (Subscriber& one : conversation_.subscribers())
      one.datagrams.settle(frames_.port_for(one).batch());
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    const Instant now = clock_.now();
    const auto& config = conversation_.server().config;
    const std::string axes = std::string(name_of(config.up)) + " m";
    for (const auto& one : conversation_.subscribers()) {
      std::string detail = "bitstream " + fiducap::natnet::text_of(one.version) + ", " + axes;
      if (!one.name.empty()) detail = one.name + ", " + detail;
      if (!one.selection.is_everything()) detail += ", some bodies";
      out.push_back({"natnet", text_of(one.peer) + " udp", std::move(detail),
                     one.datagrams.frames_sent(), one.datagrams.frames_dropped(),
                     to_seconds(now - one.since)});
    }
    const std::string interfaces = groups_.interfaces_text();
    if (!groups_.has_groups() || interfaces.empty()) return;
    out.push_back({"natnet", groups_text(groups_) + " multicast",
                   "by " + interfaces + ", bitstream " + config.bitstream + ", " + axes,
                   groups_.counts().frames_sent(), groups_.counts().frames_dropped(),
                   first_frame_at_ ? to_seconds(now - *first_frame_at_) : 0.0});
  }

  void stop() override {
    stopped_ = true;
    if (commands_) commands_->stop();
    if (unicast_) unicast_->stop();
    for (auto& one : broadcasts_) one.stop();
  }

 private:
  Expected<void> listen(boost::asio::io_context& io, const net::BindTarget& target, Channel channel,
                        std::optional<net::UdpServer>& commands) {
    auto opened = net::UdpServer::open(io, target, kCommandPort);
    if (!opened) return tl::unexpected(opened.error());
    commands.emplace(std::move(*opened));
    // Replies are sent from the port of their channel, also to a broadcast.
    const auto handler = [this, channel, &commands](const net::UdpServer::Datagram& request) {
      answer(request, channel, *commands);
    };
    commands->start(handler);
    const bool own_only = is_own_machine(parse_address(target.address).value_or(0));
    for (const auto& address : broadcast_addresses(target.address)) {
      // Optional: without discovery by broadcast the address is configured in the client.
      auto heard = net::UdpServer::open(io, {address, commands->port(), kKey}, kCommandPort);
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

  void answer(const net::UdpServer::Datagram& request, Channel channel, net::UdpServer& from) {
    const auto answer = conversation_.receive(request.bytes, request.from, channel, clock_.now());
    if (!answer.empty()) from.send(answer, request.from, request.to);
    if (conversation_.asked_for_group() && groups_.add_interface_of(request.to))
      log::info("natnet", net::address_text(request.from) + " asked: frames are sent to " +
                              groups_text(groups_) + " by " + groups_.interfaces_text());
  }

  void remove_gone_clients(Instant now) {
    if (commands_) read_refusals(*commands_, now);
    if (unicast_) read_refusals(*unicast_, now);
    while (const auto peer = frames_.next_refused()) {
      if (conversation_.remove(*peer))
        log::info("natnet", text_of(*peer) + " is removed: its port is closed");
    }
    if (const auto silent = conversation_.expire(now); silent > 0)
      log::info("natnet", std::to_string(silent) + " client(s) timed out and were removed");
  }

  void read_refusals(net::UdpServer& commands, Instant now) {
    while (const auto peer = commands.next_refused()) conversation_.reply_refused(*peer, now);
  }

  const Clock& clock_;
  Conversation conversation_;
  GroupSender groups_;
  std::optional<Instant> first_frame_at_;
  bool stopped_{false};
  FramePorts frames_;
  std::optional<net::UdpServer> commands_;
  std::optional<net::UdpServer> unicast_;  ///< Replies without a group.
  std::vector<net::UdpServer> broadcasts_;
};

std::string where_text(const NatNetConfig& config, const NatNetServer& server) {
  const std::string commands = config.address + ":" + std::to_string(server.port()) + " (UDP)";
  if (!config.multicast) return commands + ", to each client";
  std::string text =
      commands + ", to " + config.multicast_group + ":" + std::to_string(config.data_port);
  if (server.second_port() == 0) return text;
  return text + " and to each client that keeps alive; port " +
         std::to_string(server.second_port()) + " names no group";
}

}  // namespace

StartedStreamer serve(const ProtocolContext& context, const NatNetConfig& config) {
  if (const std::size_t bodies = context.model->bodies.size(); bodies > kMaxBodies)
    return fail(ErrorCode::kInvalid, "NatNet clients take at most " + std::to_string(kMaxBodies) +
                                         " bodies, the scene has " + std::to_string(bodies));
  auto frames = net::UdpServer::open(context.io, {config.address, 0, kKey}, kFramePort);
  if (!frames) return tl::unexpected(frames.error());
  auto groups = GroupSender::open(context.io, config);
  if (!groups) return tl::unexpected(groups.error());
  Conversation conversation(
      config, context.model, context.operator_api, context.rate_hz, net::random_word(),
      net::TrustedNetworks(config.trusted_networks(),
                           config.clients.empty() ? net::attached_networks : net::own_addresses),
      context.clock.now());
  auto server =
      std::make_unique<NatNetServer>(FramePorts(context.io, config, std::move(*frames)),
                                     std::move(*groups), std::move(conversation), context.clock);
  if (auto listening = server->listen(context.io, config); !listening)
    return tl::unexpected(listening.error());
  log::info("natnet", "serves NatNet " + fiducap::natnet::text_of(kOldest) + " to " +
                          fiducap::natnet::text_of(kNewest) + " on " + where_text(config, *server));
  return server;
}

}  // namespace fiducap::natnet
