#include "streaming/native/control_session.hpp"

#include <algorithm>
#include <utility>

#include "base/bytes.hpp"
#include "middleware/net/peer.hpp"
#include "proof/control_proof.hpp"

namespace fiducap::native {

namespace {

constexpr std::size_t kLengthSize = 4;
// For the first request, and for the rest of an incomplete one.
constexpr Duration kRequestTimeout = std::chrono::seconds(10);
// Between requests of an operator.
constexpr Duration kIdleTimeout = std::chrono::minutes(5);

std::int64_t version_of(const TagMap* map) { return map == nullptr ? 0 : map->version; }

}  // namespace

std::string random_challenge() {
  std::string challenge;
  while (challenge.size() < kChallengeSize) {
    const std::uint64_t word = net::random_word();
    for (int i = 0; i < 4; ++i) challenge.push_back(static_cast<char>(word >> (8 * i)));
  }
  return challenge;
}

ControlConversation::ControlConversation(std::string challenge, OperatorApi& operator_api,
                                         WrongProofs& wrong, ControlClient client)
    : challenge_(std::move(challenge)),
      operator_api_(operator_api),
      wrong_(wrong),
      client_(std::move(client)) {}

void ControlConversation::greet(std::vector<std::byte>& out, Instant now) {
  idle_since_ = now;
  ControlReply hello;
  hello.challenge = challenge_;
  append(out, hello);
}

bool ControlConversation::receive(std::span<const std::byte> bytes, std::vector<std::byte>& out,
                                  Instant now) {
  if (begun_.empty()) idle_since_ = now;
  const auto length = [this] { return std::size_t{LittleEndianReader(begun_).u32()}; };
  while (!bytes.empty()) {
    const std::size_t wanted = begun_.size() < kLengthSize ? kLengthSize : kLengthSize + length();
    const std::size_t taken = std::min(wanted - begun_.size(), bytes.size());
    begun_.insert(begun_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(taken));
    bytes = bytes.subspan(taken);
    if (begun_.size() < kLengthSize) return true;
    if (length() > kMaxControlMessage) {
      append(out, {sequence_ + 1, ControlResult::kMalformed,
                   "a message has at most 65536 bytes, this one has " + std::to_string(length())});
      return false;
    }
    if (begun_.size() < kLengthSize + length()) continue;
    const bool is_open = answer(std::span(begun_).subspan(kLengthSize), out, now);
    begun_.clear();
    if (!is_open) return false;
  }
  return true;
}

void ControlConversation::append_events(std::vector<std::byte>& out, Instant now) {
  if (feed_) feed_->append_new(out, now);
}

bool ControlConversation::is_alive(Instant now) const {
  if (feed_) return true;  // closed when it does not read the heartbeats
  const bool waits_for_request = sequence_ == 0 || !begun_.empty();
  return now - idle_since_ < (waits_for_request ? kRequestTimeout : kIdleTimeout);
}

bool ControlConversation::answer(std::span<const std::byte> message, std::vector<std::byte>& out,
                                 Instant now) {
  const auto request = decode_control_request(message);
  const auto refuse = [&](ControlResult result, const std::string& why) {
    append(out, {request ? request->sequence : sequence_ + 1, result, why});
    return false;
  };
  if (!request) return refuse(ControlResult::kMalformed, request.error().what);
  if (feed_ || request->watch_after) return watch(*request, out, now);
  if (wrong_.shut_out(client_.address_hash, now))
    return refuse(ControlResult::kBusy, "too many wrong tokens from this address: wait 10 s");
  const bool is_readable = client_.reads_only && !operator_api_.read_token().empty();
  if (operator_api_.token().empty() && !is_readable)
    return refuse(ControlResult::kForbidden,
                  "this server takes no commands: set operator.token or operator.token_file in its "
                  "configuration");
  if (request->sequence != sequence_ + 1 || !is_proven(*request)) {
    wrong_.note(client_.address_hash, now);
    operator_api_.note_refusal({client_.by.protocol, {}, client_.by.address}, "prove a token",
                               "wrong token");
    return refuse(ControlResult::kForbidden,
                  client_.reads_only ? "wrong token" : "wrong operator token");
  }
  sequence_ = request->sequence;
  proven_at_ = operator_api_.tokens_changed();
  const auto action = decode_control_command(request->body);
  if (action && *action && client_.reads_only)
    return refuse(ControlResult::kForbidden, "this connection takes no commands");
  ControlReply reply;
  if (action) {
    reply = carry_out(*action);
  } else {
    const bool later = action.error().code == ErrorCode::kUnsupported;
    reply.result = later ? ControlResult::kUnsupported : ControlResult::kRefused;
    reply.text = action.error().what;
  }
  reply.sequence = sequence_;
  append(out, reply);
  return true;
}

bool ControlConversation::watch(const ControlRequest& request, std::vector<std::byte>& out,
                                Instant now) {
  if (feed_ || client_.events == nullptr) {
    const auto [result, why] =
        feed_ ? std::pair{ControlResult::kMalformed, "no request may follow a request for events"}
              : std::pair{ControlResult::kUnsupported, "this server has no events"};
    append(out, {request.sequence, result, why});
    return false;
  }
  feed_.emplace(*client_.events, *request.watch_after, request.sequence);
  append_events(out, now);
  return true;
}

bool ControlConversation::is_proven(const ControlRequest& request) const {
  proof::Digest given{};
  if (request.proof.size() != given.size()) return false;
  std::copy(request.proof.begin(), request.proof.end(), given.begin());
  const auto proves = [&](const std::string& token) {
    return !token.empty() &&
           proof::equal(given,
                        proof::control_proof(token, challenge_, request.sequence, request.body));
  };
  return proves(operator_api_.token()) ||
         (client_.reads_only && proves(operator_api_.read_token()));
}

ControlReply ControlConversation::carry_out(const ControlAction& action) {
  ControlReply reply;
  if (!action) {
    reply.state = ControlState{operator_api_.bodies(), operator_api_.map_mode(),
                               operator_api_.recording().value_or(""), operator_api_.recordings(),
                               version_of(operator_api_.map().get())};
  } else if (const auto done = action(operator_api_, client_.by); !done) {
    reply.result = ControlResult::kRefused;
    reply.text = done.error().text();
  }
  return reply;
}

class ControlServer::Session final : public net::TcpSession {
 public:
  Session(net::Socket socket, const Clock& clock, OperatorApi& operator_api, WrongProofs& wrong,
          std::uint64_t address_hash, SharedEvents* events)
      : TcpSession(std::move(socket), "native", clock),
        conversation_(
            random_challenge(), operator_api, wrong,
            {address_hash, {"native", kOperatorRight, net::text_of(peer())}, false, events}) {
    conversation_.greet(replies(), this->clock().now());
  }

  /// Operators keep their place; other clients have kTimeToProve.
  [[nodiscard]] bool may_be_replaced(Instant now) const override {
    return !conversation_.is_admitted() && now - since() >= kTimeToProve;
  }

 protected:
  void received(std::span<const std::byte> bytes) override {
    if (hanging_up_) return;
    hanging_up_ = !conversation_.receive(bytes, replies(), clock().now());
    flush();
    // The last reply is sent first; a later tick closes the connection.
    if (hanging_up_) hang_up_at_ = clock().now() + kCloseDelay;
  }
  void ticked(Instant now) override {
    if (hanging_up_ && now >= hang_up_at_) return close("was refused");
    if (hanging_up_) return;
    if (!conversation_.is_alive(now)) return close("was silent for too long");
    conversation_.append_events(replies(), now);
    flush();
  }

 private:
  static constexpr Duration kCloseDelay = std::chrono::milliseconds(200);
  static constexpr Duration kTimeToProve = std::chrono::seconds(2);

  ControlConversation conversation_;
  bool hanging_up_{false};
  Instant hang_up_at_{};
};

ControlServer::ControlServer(boost::asio::io_context& io, OperatorApi& operator_api,
                             const EventBoard* events, const Clock& clock)
    : operator_api_(operator_api),
      clock_(clock),
      hash_key_(net::random_key()),
      tcp_(io, {"native", kMostClients, kMostPerAddress}, clock) {
  if (events != nullptr) events_.emplace(*events);
}

Expected<void> ControlServer::listen(const net::BindTarget& target) {
  const auto port = tcp_.listen(target, [this](net::Socket socket, const net::Peer& peer) {
    return session(std::move(socket), peer);
  });
  if (!port) return tl::unexpected(port.error());
  tcp_.start();
  return {};
}

std::shared_ptr<net::Session> ControlServer::session(net::Socket socket, const net::Peer& peer) {
  const std::uint64_t hash = net::address_hash(hash_key_, peer);
  // After wrong proofs the connection is closed without a reply.
  if (wrong_.shut_out(hash, clock_.now())) return nullptr;
  return std::make_shared<Session>(std::move(socket), clock_, operator_api_, wrong_, hash,
                                   events_ ? &*events_ : nullptr);
}

}  // namespace fiducap::native
