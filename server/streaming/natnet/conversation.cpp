#include "streaming/natnet/conversation.hpp"

#include <algorithm>
#include <utility>

#include "base/log.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::array<std::uint8_t, 4> kApplicationVersion{0, 1, 0, 0};
constexpr Duration kRecordingPoll = std::chrono::milliseconds(100);

std::array<std::uint8_t, 4> octets(std::uint32_t address) {
  return {static_cast<std::uint8_t>(address >> 24), static_cast<std::uint8_t>(address >> 16),
          static_cast<std::uint8_t>(address >> 8), static_cast<std::uint8_t>(address)};
}

RegistryLimits limits_of(const NatNetConfig& config) {
  return {config.max_clients, config.max_clients_per_address,
          from_seconds(config.client_timeout_s)};
}

}  // namespace

Conversation::Conversation(const NatNetConfig& config, std::shared_ptr<const SceneModel> model,
                           OperatorApi* operator_api, double rate_hz, std::uint64_t key,
                           net::TrustedNetworks networks, Instant epoch)
    : registry_(limits_of(config)),
      guard_(key, std::move(networks)),
      encoder_(config.axes(), config.when_invalid, epoch) {
  server_.config = config;
  server_.operator_api = operator_api;
  server_.rate_hz = rate_hz;
  use(std::move(model));
  for (const Peer& listener : config.listeners())
    registry_.add_fixed(listener, config.default_bitstream(), epoch);
}

void Conversation::set_ports(std::uint16_t port, std::uint16_t unicast_port) {
  server_.config.port = port;
  server_.config.unicast_port = unicast_port;
}

void Conversation::use(std::shared_ptr<const SceneModel> model) {
  server_.model = std::move(model);
  server_.announced = announced_bodies(*server_.model, kNames, server_.config.aliases);
  for (auto& encoded : models_) encoded.clear();
}

Conversation::Bytes Conversation::receive(std::span<const std::byte> datagram, const Peer& from,
                                          Channel channel, Instant now) {
  Sender sender{from, channel, now, guard_.heard(from, datagram.size(), now), nullptr};
  asked_for_group_ = false;
  const auto request = decode_request(datagram);
  if (!request) return {};
  sender.subscriber = registry_.find(from);
  quiet_.heard(from);
  if (sender.subscriber != nullptr) sender.subscriber->heard_at = now;
  const Bytes answer = std::visit([&](const auto& what) { return on(what, sender); }, *request);
  // Discovery does not subscribe.
  asked_for_group_ = channel == Channel::kMulticast && sender.before.trusted &&
                     sender.subscriber == nullptr && !answer.empty() &&
                     !std::holds_alternative<DiscoveryRequest>(*request);
  if (answer.empty() || guard_.may_answer(from, answer.size(), sender.before.trusted, now))
    return answer;
  return {};
}

Conversation::Bytes Conversation::on(const ConnectRequest& request, Sender& sender) {
  const Bitstream version = version_for(request.versions, sender);
  guard_.set_version(sender.from, version);
  if (sender.channel == Channel::kMulticast) {
    if (request.versions.wanted && sender.before.trusted) quiet_.connected(sender.from, sender.now);
    return info(version, sender);
  }
  // An empty one does not subscribe: some clients take the next datagram for its reply.
  if (request.empty) warn_listener(sender);
  if (!request.empty) subscribe(sender, version, request.name, sender.now + kHold);
  if (sender.subscriber != nullptr) {
    sender.subscriber->version = version;
    sender.subscriber->library = request.versions.library.value_or(Bitstream{});
    if (request.subscribed_data_only) sender.subscriber->selection.only_subscribed();
  }
  return info(version, sender);
}

Conversation::Bytes Conversation::on(const DiscoveryRequest& request, Sender& sender) {
  return info(version_for(request.versions, sender), sender);
}

Conversation::Bytes Conversation::on(const KeepAliveRequest& request, Sender& sender) {
  if (!server_.config.unicast) return {};
  // After a restart of the server a client continues with keep-alives and its earlier version.
  const bool is_known = sender.before.version != Bitstream{};
  subscribe(sender, is_known ? sender.before.version : version_for(request.versions, sender),
            request.name, sender.now);
  if (sender.subscriber != nullptr && request.versions.library)
    sender.subscriber->library = *request.versions.library;
  return {};
}

Conversation::Bytes Conversation::on(const DisconnectRequest&, Sender& sender) {
  if (sender.subscriber != nullptr && registry_.remove(sender.from))
    log::info("natnet", text_of(sender.from) + " left");
  return {};
}

Conversation::Bytes Conversation::on(const EchoRequest& request, Sender& sender) {
  return reply(encode_echo(request.client_ticks, sender.now));
}

Conversation::Bytes Conversation::on(const ModelRequest& request, Sender& sender) {
  const ModelLayout layout = model_layout(version_of(sender));
  if ((request.types & ModelRequest::kRigidBodies) == 0)
    return reply(encode_model(server_.announced, layout, request.types));
  Datagram& encoded = models_[static_cast<std::size_t>(layout)];
  if (encoded.empty()) encoded = encode_model(server_.announced, layout);
  return encoded;
}

Conversation::Bytes Conversation::on(const FrameRequest&, Sender& sender) {
  if (!server_.frame) return {};
  return frame({frame_layout(version_of(sender))}, sender.now);
}

Conversation::Bytes Conversation::on(const CommandRequest& request, Sender& sender) {
  // A command that an old vendor library requires and that is not supported (reference, 4.4).
  if (request.text.starts_with("service20,"))
    log::debug("natnet",
               text_of(sender.from) +
                   ": its NatNet library is too old for this server, it needs 4.1 or later");
  auto answer = words_.answer(
      request.text, server_,
      {sender.from, sender.channel == Channel::kMulticast && sender.subscriber == nullptr,
       version_of(sender), sender.subscriber});
  if (answer.switch_to) switch_to(*answer.switch_to, sender);
  if (answer.leaves) on(DisconnectRequest{}, sender);
  recording_asked_at_ = {};
  return reply(std::move(answer.datagram));
}

void Conversation::subscribe(Sender& sender, Bitstream version, const std::string& name,
                             Instant frames_from) {
  if (sender.subscriber == nullptr) {
    if (sender.before.trusted) sender.subscriber = registry_.add(sender.from, sender.now);
    if (sender.subscriber == nullptr) return warn_refused(sender);
    sender.subscriber->version = version;
    sender.subscriber->frames_from = frames_from;
  }
  sender.subscriber->frames_from = std::min(sender.subscriber->frames_from, frames_from);
  if (!name.empty()) sender.subscriber->name = name;
}

/// Logs why a client gets no frames, with the remedy; rate-limited.
void Conversation::warn_refused(const Sender& sender) {
  if (!guard_.may_warn(sender.from, sender.now)) return;
  const std::string address = net::address_text(sender.from);
  log::warning("natnet",
               sender.before.trusted
                   ? address + " gets no frames: all " +
                         std::to_string(server_.config.max_clients) + " places, or its own " +
                         std::to_string(server_.config.max_clients_per_address) +
                         ", are taken (streaming.natnet.max_clients, max_clients_per_address)"
               : server_.config.clients.empty()
                   ? address +
                         " gets no frames: it is not in an attached network. Serve it with "
                         "streaming.natnet.networks: [" +
                         net::text_of(net::usual_network_of(sender.from)) + "]"
                   : address + " gets no frames: it is not in streaming.natnet.clients");
}

/// Such clients only listen at the data port.
void Conversation::warn_listener(const Sender& sender) {
  if (server_.config.multicast || !sender.before.trusted) return;
  const auto is_served = [&](const Subscriber& one) {
    return one.fixed && one.peer.same_address(sender.from);
  };
  if (std::ranges::any_of(registry_.all(), is_served)) return;
  if (!guard_.may_warn(sender.from, sender.now)) return;
  const std::string port = std::to_string(server_.config.data_port);
  log::warning("natnet", text_of(sender.from) + " only listens at port " + port +
                             ": no frames are sent there. Switch streaming.natnet.multicast on, "
                             "or set streaming.natnet.targets: [\"" +
                             net::address_text(sender.from) + ":" + port + "\"]");
}

void Conversation::reply_refused(const Peer& peer, Instant now) {
  if (registry_.remove(peer))
    log::info("natnet", text_of(peer) + " is removed: its port is closed");
  if (!guard_.may_warn(peer, now)) return;
  log::info("natnet", text_of(peer) + " closed its port before the reply arrived");
}

std::size_t Conversation::expire(Instant now) {
  while (const auto peer = quiet_.next(now)) {
    if (!guard_.may_warn(*peer, now)) continue;
    log::warning(
        "natnet",
        text_of(*peer) +
            " connected at the multicast port and ended, as the "
            "vendor's library does in unicast mode. Set it to multicast, or to " +
            (server_.config.unicast ? "port " + std::to_string(server_.config.unicast_port) +
                                          " (streaming.natnet.unicast_port)"
                                    : std::string("unicast with streaming.natnet.unicast: true")));
  }
  return registry_.expire(now);
}

void Conversation::switch_to(Bitstream version, Sender& sender) {
  guard_.set_version(sender.from, version);
  if (sender.subscriber == nullptr) return;
  sender.subscriber->version = version;
  sender.subscriber->bitstream_changed_until = sender.now + kAnnounce;
}

Bitstream Conversation::version_for(const ClientVersions& versions, const Sender& sender) const {
  const Bitstream ours = server_.config.default_bitstream();
  return sender.channel == Channel::kMulticast ? ours : negotiate(versions, ours);
}

Bitstream Conversation::version_of(const Sender& sender) const {
  if (sender.subscriber != nullptr) return sender.subscriber->version;
  const bool is_known = sender.before.version != Bitstream{};
  return is_known ? sender.before.version : server_.config.default_bitstream();
}

Conversation::Bytes Conversation::info(Bitstream version, const Sender& sender) {
  const NatNetConfig& config = server_.config;
  return reply(encode(ServerInfo{kApplicationVersion, version, config.data_port,
                                 sender.channel == Channel::kMulticast,
                                 octets(parse_address(config.multicast_group).value_or(0))}));
}

void Conversation::take(std::shared_ptr<const SceneFrame> frame, Instant now) {
  if (frame->model->generation != server_.model->generation) {
    use(frame->model);
    model_changed_until_ = now + kAnnounce;
  }
  server_.frame = std::move(frame);
  server_.rate_hz = server_.frame->rate_hz;
  loaded_ = false;
  if (server_.operator_api != nullptr && now - recording_asked_at_ >= kRecordingPoll) {
    recording_ = server_.operator_api->recording().has_value();
    recording_asked_at_ = now;
  }
}

Conversation::Bytes Conversation::frame_for(const Subscriber& subscriber, Instant now) {
  if (!server_.frame || now < subscriber.frames_from) return {};
  return frame({frame_layout(subscriber.version), now < subscriber.bitstream_changed_until,
                &subscriber.selection},
               now);
}

Conversation::Bytes Conversation::multicast_frame(Instant now) {
  if (!server_.frame) return {};
  return frame({frame_layout(server_.config.default_bitstream())}, now);
}

Conversation::Bytes Conversation::frame(const FrameProfile& profile, Instant now) {
  if (!loaded_) {
    const int bits = (recording_ ? FrameBits::kRecording : 0) |
                     (now < model_changed_until_ ? FrameBits::kModelChanged : 0);
    encoder_.load(*server_.frame, now, static_cast<std::int16_t>(bits));
    loaded_ = true;
  }
  return encoder_.encode(profile);
}

Conversation::Bytes Conversation::reply(Datagram datagram) {
  reply_ = std::move(datagram);
  return reply_;
}

}  // namespace fiducap::natnet
