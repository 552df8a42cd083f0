#include "streaming/natnet/natnet_server.hpp"

#include <boost/asio/io_context.hpp>
#include <random>
#include <utility>
#include <vector>

#include "base/log.hpp"
#include "streaming/natnet/command_socket.hpp"
#include "streaming/natnet/conversation.hpp"
#include "streaming/natnet/frame_sender.hpp"
#include "streaming/natnet/interfaces.hpp"
#include "streaming/natnet/wire.hpp"
#include "streaming/server_handle.hpp"

namespace fiducap::natnet {

namespace {

namespace asio = boost::asio;
using boost::system::error_code;

// Requests handled before other work of the I/O thread gets its turn.
constexpr int kRequestsPerTurn = 64;
constexpr std::size_t kLongestDatagram = 65536;

std::uint64_t random_word() {
  std::random_device device;
  return std::uint64_t{device()} << 32 | device();
}

/// Shared with the pending waits of the sockets, which may outlive the streamer in the I/O queue.
class NatNetServer final : public std::enable_shared_from_this<NatNetServer> {
 public:
  NatNetServer(std::vector<CommandSocket> sockets, FrameSender sender, Conversation conversation,
               const NatNetConfig& config, const Clock& clock)
      : clock_(clock),
        sockets_(std::move(sockets)),
        sender_(std::move(sender)),
        conversation_(std::move(conversation)),
        group_(config.multicast
                   ? parse_peer(config.multicast_group + ":" + std::to_string(config.data_port))
                   : std::nullopt) {
    conversation_.set_ports(port(Channel::kUnicast), port(Channel::kMulticast));
    addressees_.reserve(conversation_.subscribers().size());
  }

  void listen() {
    for (std::size_t i = 0; i < sockets_.size(); ++i) listen(i);
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame);
  void append_clients(std::vector<ClientStatus>& out) const;
  void stop() {
    error_code ignored;
    for (auto& one : sockets_) one.socket().close(ignored);
    stopped_ = true;
  }
  [[nodiscard]] std::uint16_t port(Channel channel) const {
    for (const auto& one : sockets_) {
      if (one.channel() == channel) return one.port();
    }
    return 0;
  }

 private:
  void listen(std::size_t socket);
  void answer_requests(CommandSocket& socket);
  void forget_the_gone(Instant now);
  void count_sent();
  /// Answers leave from the port of their channel, also when the question came by broadcast.
  CommandSocket& answering(Channel channel);

  const Clock& clock_;
  std::vector<CommandSocket>
      sockets_;  ///< The one of each channel first, then those that hear broadcasts.
  FrameSender sender_;
  Conversation conversation_;
  std::optional<Peer> group_;
  std::vector<std::size_t> addressees_;  ///< Places of subscribers in the batch under way.
  std::uint64_t group_sent_{0};
  std::uint64_t group_dropped_{0};
  std::optional<Instant> group_since_;
  bool stopped_{false};
  std::array<std::byte, kLongestDatagram> request_{};
};

void NatNetServer::listen(std::size_t socket) {
  sockets_[socket].socket().async_wait(asio::ip::udp::socket::wait_read,
                                       [weak = weak_from_this(), socket](const error_code& error) {
                                         const auto self = weak.lock();
                                         if (!self || error || self->stopped_) return;
                                         self->answer_requests(self->sockets_[socket]);
                                         self->listen(socket);
                                       });
}

void NatNetServer::answer_requests(CommandSocket& socket) {
  CommandSocket& out = answering(socket.channel());
  for (int i = 0; i < kRequestsPerTurn; ++i) {
    const auto received = socket.receive(request_);
    if (!received) return;
    const auto answer =
        conversation_.receive(received->datagram, received->from, socket.channel(), clock_.now());
    if (!answer.empty()) out.send(answer, received->from, received->to);
  }
}

CommandSocket& NatNetServer::answering(Channel channel) {
  for (auto& one : sockets_) {
    if (one.channel() == channel) return one;
  }
  return sockets_.front();
}

void NatNetServer::publish(const std::shared_ptr<const SceneFrame>& frame) {
  if (stopped_) return;
  const Instant now = clock_.now();
  forget_the_gone(now);
  conversation_.take(frame, now);
  sender_.clear();
  addressees_.clear();
  const auto subscribers = conversation_.subscribers();
  for (std::size_t i = 0; i < subscribers.size(); ++i) {
    const auto bytes = conversation_.frame_for(subscribers[i], now);
    if (bytes.empty()) continue;
    sender_.add(bytes, subscribers[i].peer);
    addressees_.push_back(i);
  }
  if (group_) {
    if (!group_since_) group_since_ = now;
    sender_.add(conversation_.multicast_frame(now), *group_);
  }
  if (sender_.size() == 0) return;
  sender_.send();
  count_sent();
}

void NatNetServer::forget_the_gone(Instant now) {
  while (const auto peer = sender_.next_refused()) {
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
    ++(sender_.sent(i) ? to.frames_sent : to.frames_dropped);
  }
  if (group_) ++(sender_.sent(addressees_.size()) ? group_sent_ : group_dropped_);
}

void NatNetServer::append_clients(std::vector<ClientStatus>& out) const {
  const Instant now = clock_.now();
  const auto& config = conversation_.server().config;
  const std::string axes = std::string(name_of(config.up)) + " m";
  for (const auto& one : conversation_.subscribers()) {
    if (one.stranger) continue;
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

class Handle final : public ServerHandle<NatNetStreamer, NatNetServer> {
 public:
  using ServerHandle::ServerHandle;
  [[nodiscard]] std::uint16_t port() const override { return server().port(Channel::kUnicast); }
  [[nodiscard]] std::uint16_t multicast_command_port() const override {
    return server().port(Channel::kMulticast);
  }
};

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

/// The command sockets of both channels, and those that only hear broadcasts.
Expected<std::vector<CommandSocket>> open_sockets(asio::io_context& io,
                                                  const NatNetConfig& config) {
  struct Door {
    Channel channel;
    bool open;
    std::uint16_t port;
    std::string_view key;
  };
  std::vector<CommandSocket> sockets;
  for (const Door& door : {Door{Channel::kUnicast, config.unicast, config.port, "port"},
                           Door{Channel::kMulticast, config.multicast,
                                config.multicast_command_port, "multicast_command_port"}}) {
    if (!door.open) continue;
    auto socket = CommandSocket::open(io, {config.address, door.port, "streaming.natnet", door.key},
                                      door.channel);
    if (!socket) return tl::unexpected(socket.error());
    sockets.push_back(std::move(*socket));
  }
  const std::size_t doors = sockets.size();
  for (std::size_t i = 0; i < doors; ++i) {
    for (const auto& address : broadcast_addresses(config.address)) {
      // Discovery by broadcast is a comfort; without it a client is told the address.
      auto ear = CommandSocket::open(io, {address, sockets[i].port(), "streaming.natnet"},
                                     sockets[i].channel());
      if (ear) sockets.push_back(std::move(*ear));
    }
  }
  return sockets;
}

}  // namespace

Expected<std::unique_ptr<NatNetStreamer>> start_natnet_server(
    asio::io_context& io, const NatNetConfig& config, std::shared_ptr<const SceneModel> model,
    const Clock& clock, OperatorDesk* desk, double rate_hz) {
  if (model->bodies.size() > kMaxBodies) {
    return fail(ErrorCode::kInvalid, "NatNet clients take at most " + std::to_string(kMaxBodies) +
                                         " bodies, the scene has " +
                                         std::to_string(model->bodies.size()));
  }
  auto sockets = open_sockets(io, config);
  if (!sockets) return tl::unexpected(sockets.error());
  auto sender = FrameSender::open(io, config);
  if (!sender) return tl::unexpected(sender.error());
  Conversation conversation(config, std::move(model), desk, rate_hz, random_word(), clock.now());
  auto server = std::make_shared<NatNetServer>(std::move(*sockets), std::move(*sender),
                                               std::move(conversation), config, clock);
  server->listen();
  log::info("natnet", "serves NatNet " + fiducap::natnet::text_of(kOldest) + " to " +
                          fiducap::natnet::text_of(kNewest) + " on " + where_text(config, *server));
  return std::make_unique<Handle>("natnet", std::move(server));
}

}  // namespace fiducap::natnet
