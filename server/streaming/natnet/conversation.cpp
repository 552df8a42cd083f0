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
                           OperatorDesk* desk, double rate_hz, std::uint64_t key,
                           net::TrustedNetworks networks, Instant epoch)
    : registry_(limits_of(config)),
      guard_(key, std::move(networks)),
      encoder_(config.axes(), config.when_invalid, epoch) {
  server_.config = config;
  server_.desk = desk;
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
  server_.announced =
      announced_bodies(*server_.model, server_.config.name_rule(), server_.config.aliases);
  for (auto& encoded : models_) encoded.clear();
}

Conversation::Bytes Conversation::receive(std::span<const std::byte> datagram, const Peer& from,
                                          Channel channel, Instant now) {
  Turn turn{from, channel, now, guard_.heard(from, datagram.size(), now), nullptr};
  asked_for_group_ = false;
  const auto request = decode_request(datagram);
  if (!request) {
    ++unanswered_.malformed;
    return {};
  }
  turn.subscriber = registry_.find(from);
  quiet_.heard(from);
  if (turn.subscriber != nullptr) turn.subscriber->heard_at = now;
  const Bytes answer = std::visit([&](const auto& what) { return on(what, turn); }, *request);
  // Who only looks who is there wants no frames yet.
  asked_for_group_ = channel == Channel::kMulticast && turn.before.trusted &&
                     turn.subscriber == nullptr && !answer.empty() &&
                     !std::holds_alternative<DiscoveryRequest>(*request);
  if (answer.empty() || guard_.may_answer(from, answer.size(), turn.before.trusted, now))
    return answer;
  ++unanswered_.too_much;
  return {};
}

Conversation::Bytes Conversation::on(const ConnectRequest& request, Turn& turn) {
  const Bitstream version = version_for(request.versions, turn);
  guard_.promise(turn.from, version);
  if (turn.channel == Channel::kMulticast) {
    if (request.versions.wanted && turn.before.trusted) quiet_.asked(turn.from, turn.now);
    return info(version, turn);
  }
  // An empty one is also what clients send that only ask, and then take the next datagram for an
  // answer.
  if (request.empty) warn_listener(turn);
  if (!request.empty) subscribe(turn, version, request.name, turn.now + kHold);
  if (turn.subscriber != nullptr) {
    turn.subscriber->version = version;
    if (request.subscribed_data_only) turn.subscriber->selection.only_subscribed();
  }
  return info(version, turn);
}

Conversation::Bytes Conversation::on(const DiscoveryRequest& request, Turn& turn) {
  return info(version_for(request.versions, turn), turn);
}

Conversation::Bytes Conversation::on(const KeepAliveRequest& request, Turn& turn) {
  if (!server_.config.unicast) return {};
  // After a restart of the server a client goes on with these; it keeps reading the version it was
  // told then.
  const bool told = turn.before.version != Bitstream{};
  subscribe(turn, told ? turn.before.version : version_for(request.versions, turn), request.name,
            turn.now);
  return {};
}

Conversation::Bytes Conversation::on(const DisconnectRequest&, Turn& turn) {
  if (turn.subscriber != nullptr && registry_.remove(turn.from))
    log::info("natnet", text_of(turn.from) + " left");
  return {};
}

Conversation::Bytes Conversation::on(const EchoRequest& request, Turn& turn) {
  return say(encode_echo(request.client_ticks, turn.now));
}

Conversation::Bytes Conversation::on(const ModelRequest& request, Turn& turn) {
  const ModelLayout layout = model_layout(version_of(turn));
  if ((request.types & ModelRequest::kRigidBodies) == 0) {
    return say(encode_model(server_.announced, layout, request.types));
  }
  Datagram& encoded = models_[static_cast<std::size_t>(layout)];
  if (encoded.empty()) encoded = encode_model(server_.announced, layout);
  return encoded;
}

Conversation::Bytes Conversation::on(const FrameRequest&, Turn& turn) {
  if (!server_.frame) return {};
  return frame({frame_layout(version_of(turn))}, turn.now);
}

Conversation::Bytes Conversation::on(const CommandRequest& request, Turn& turn) {
  if (CommandWords::is_legacy_check(request.text)) {
    log::debug("natnet",
               text_of(turn.from) +
                   ": its NatNet library is too old for this server, it needs 4.1 or later");
  }
  auto answer =
      words_.answer(request.text, server_,
                    {turn.from, turn.channel == Channel::kMulticast && turn.subscriber == nullptr,
                     version_of(turn), turn.subscriber});
  if (answer.switch_to) switch_to(*answer.switch_to, turn);
  if (answer.leaves && turn.subscriber != nullptr && registry_.remove(turn.from)) {
    log::info("natnet", text_of(turn.from) + " left");
  }
  recording_asked_at_ = {};
  return say(std::move(answer.datagram));
}

void Conversation::subscribe(Turn& turn, Bitstream version, const std::string& name,
                             Instant frames_from) {
  if (turn.subscriber == nullptr) {
    if (turn.before.trusted) turn.subscriber = registry_.add(turn.from, turn.now);
    if (turn.subscriber == nullptr) return refuse(turn);
    turn.subscriber->version = version;
    turn.subscriber->frames_from = frames_from;
  }
  turn.subscriber->frames_from = std::min(turn.subscriber->frames_from, frames_from);
  if (!name.empty()) turn.subscriber->name = name;
}

/// Says once in a while why somebody gets no frames, and what would change it.
void Conversation::refuse(const Turn& turn) {
  ++(turn.before.trusted ? unanswered_.full : unanswered_.untrusted);
  if (!guard_.may_complain(turn.from, turn.now)) return;
  const std::string who = net::address_text(turn.from);
  log::warning("natnet",
               turn.before.trusted
                   ? who + " gets no frames: all " + std::to_string(server_.config.max_clients) +
                         " places, or its own " +
                         std::to_string(server_.config.max_clients_per_address) +
                         ", are taken (streaming.natnet.max_clients, max_clients_per_address)"
                   : who +
                         " gets no frames: it is in no network of this machine. Serve it with "
                         "streaming.natnet.networks: [" +
                         net::text_of(net::usual_network_of(turn.from)) + "]");
}

/// Who asks in this way listens at the data port only.
void Conversation::warn_listener(const Turn& turn) {
  if (server_.config.multicast || !turn.before.trusted) return;
  const auto is_served = [&](const Subscriber& one) {
    return one.fixed && one.peer.same_address(turn.from);
  };
  if (std::ranges::any_of(registry_.all(), is_served)) return;
  if (!guard_.may_complain(turn.from, turn.now)) return;
  const std::string port = std::to_string(server_.config.data_port);
  log::warning("natnet", text_of(turn.from) +
                             " asked as clients do that then only listen at port " + port +
                             ": no frames come there. Switch streaming.natnet.multicast on, "
                             "or set streaming.natnet.targets: [\"" +
                             net::address_text(turn.from) + ":" + port + "\"]");
}

void Conversation::refused_answer(const Peer& peer, Instant now) {
  if (registry_.remove(peer)) log::info("natnet", text_of(peer) + " is gone: its port is closed");
  if (!guard_.may_complain(peer, now)) return;
  log::info("natnet",
            text_of(peer) + " asked and ended before the answer came: its port is closed");
}

std::size_t Conversation::expire(Instant now) {
  while (const auto peer = quiet_.next(now)) {
    if (!guard_.may_complain(*peer, now)) continue;
    log::warning(
        "natnet",
        text_of(*peer) +
            " was told to join the group and went away, as the "
            "vendor's library does in unicast mode. Set it to multicast, or to " +
            (server_.config.unicast ? "port " + std::to_string(server_.config.unicast_port) +
                                          " (streaming.natnet.unicast_port)"
                                    : std::string("unicast with streaming.natnet.unicast: true")));
  }
  return registry_.expire(now);
}

void Conversation::switch_to(Bitstream version, Turn& turn) {
  guard_.promise(turn.from, version);
  if (turn.subscriber == nullptr) return;
  turn.subscriber->version = version;
  turn.subscriber->bitstream_changed_until = turn.now + kAnnounce;
}

Bitstream Conversation::version_for(const ClientVersions& versions, const Turn& turn) const {
  const Bitstream ours = server_.config.default_bitstream();
  return turn.channel == Channel::kMulticast ? ours : negotiate(versions, ours);
}

Bitstream Conversation::version_of(const Turn& turn) const {
  if (turn.subscriber != nullptr) return turn.subscriber->version;
  const bool told = turn.before.version != Bitstream{};
  return told ? turn.before.version : server_.config.default_bitstream();
}

Conversation::Bytes Conversation::info(Bitstream version, const Turn& turn) {
  const NatNetConfig& config = server_.config;
  return say(encode(ServerInfo{kApplicationVersion, version, config.data_port,
                               turn.channel == Channel::kMulticast,
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
  if (server_.desk != nullptr && now - recording_asked_at_ >= kRecordingPoll) {
    recording_ = server_.desk->recording().has_value();
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

Conversation::Bytes Conversation::say(Datagram datagram) {
  answer_ = std::move(datagram);
  return answer_;
}

}  // namespace fiducap::natnet
