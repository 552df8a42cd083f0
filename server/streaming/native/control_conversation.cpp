#include "streaming/native/control_conversation.hpp"

#include <algorithm>
#include <utility>

#include "base/byte_reader.hpp"
#include "middleware/net/peer.hpp"
#include "proof/control_proof.hpp"

namespace fiducap::native {

namespace {

constexpr std::size_t kLengthSize = 4;
// For the first request, and for the rest of one that was begun.
constexpr Duration kRequestPatience = std::chrono::seconds(10);
// Between requests of somebody who proved himself.
constexpr Duration kIdlePatience = std::chrono::minutes(5);

std::int64_t version_of(const TagMap* map) { return map == nullptr ? 0 : map->version; }

template <typename... Cases>
struct Overloaded : Cases... {
  using Cases::operator()...;
};
template <typename... Cases>
Overloaded(Cases...) -> Overloaded<Cases...>;

}  // namespace

std::string random_challenge() {
  std::string challenge;
  while (challenge.size() < kChallengeSize) {
    const std::uint64_t word = net::random_word();
    for (int i = 0; i < 4; ++i) challenge.push_back(static_cast<char>(word >> (8 * i)));
  }
  return challenge;
}

ControlConversation::ControlConversation(std::string challenge, OperatorDesk& desk,
                                         WrongProofs& wrong, std::uint64_t address_hash,
                                         EventNews* news)
    : challenge_(std::move(challenge)),
      desk_(desk),
      wrong_(wrong),
      address_hash_(address_hash),
      news_(news) {}

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
      append(out, {sequence_ + 1,
                   ControlResult::kMalformed,
                   "a message has at most 65536 bytes, this one says " + std::to_string(length()),
                   {},
                   {}});
      return false;
    }
    if (begun_.size() < kLengthSize + length()) continue;
    const bool go_on = answer(std::span(begun_).subspan(kLengthSize), out, now);
    begun_.clear();
    if (!go_on) return false;
  }
  return true;
}

void ControlConversation::tell_events(std::vector<std::byte>& out, Instant now) {
  if (feed_) feed_->tell(out, now);
}

bool ControlConversation::patient(Instant now) const {
  if (feed_) return true;  // it hears from us, and goes when it takes nothing
  const bool waits_for_request = sequence_ == 0 || !begun_.empty();
  return now - idle_since_ < (waits_for_request ? kRequestPatience : kIdlePatience);
}

bool ControlConversation::answer(std::span<const std::byte> message, std::vector<std::byte>& out,
                                 Instant now) {
  const auto request = decode_control_request(message);
  if (!request) {
    append(out, {sequence_ + 1, ControlResult::kMalformed, request.error().what, {}, {}});
    return false;
  }
  if (feed_ || request->watch_after) return watch(*request, out, now);
  if (wrong_.shut_out(address_hash_, now)) {
    append(out, {request->sequence,
                 ControlResult::kBusy,
                 "too many wrong tokens from this address: wait 10 s",
                 {},
                 {}});
    return false;
  }
  if (desk_.token().empty()) {
    append(out, {request->sequence,
                 ControlResult::kForbidden,
                 "this server takes no commands: set operator.token or operator.token_file in its "
                 "configuration",
                 {},
                 {}});
    return false;
  }
  if (request->sequence != sequence_ + 1 || !is_proven(*request)) {
    wrong_.note(address_hash_, now);
    append(out, {request->sequence, ControlResult::kForbidden, "wrong operator token", {}, {}});
    return false;
  }
  sequence_ = request->sequence;
  const auto command = decode_control_command(request->body);
  ControlReply reply;
  if (command) {
    reply = carry_out(*command);
  } else {
    const bool later = command.error().code == ErrorCode::kUnsupported;
    reply.result = later ? ControlResult::kUnsupported : ControlResult::kRefused;
    reply.text = command.error().what;
  }
  reply.sequence = sequence_;
  append(out, reply);
  return true;
}

bool ControlConversation::watch(const ControlRequest& request, std::vector<std::byte>& out,
                                Instant now) {
  if (feed_ || news_ == nullptr) {
    const auto [result, why] =
        feed_ ? std::pair{ControlResult::kMalformed, "nothing follows a request for events"}
              : std::pair{ControlResult::kUnsupported, "this server has no events"};
    append(out, {request.sequence, result, why, {}, {}});
    return false;
  }
  feed_.emplace(*news_, *request.watch_after, request.sequence);
  tell_events(out, now);
  return true;
}

bool ControlConversation::is_proven(const ControlRequest& request) const {
  proof::Digest given{};
  if (request.proof.size() != given.size()) return false;
  std::copy(request.proof.begin(), request.proof.end(), given.begin());
  return proof::equal(given, proof::control_proof(std::string(desk_.token()), challenge_,
                                                  request.sequence, request.body));
}

ControlReply ControlConversation::carry_out(const ControlCommand& command) {
  ControlReply reply;
  const auto report = [&reply](const Expected<void>& done) {
    if (done) return;
    reply.result = ControlResult::kRefused;
    reply.text = done.error().text();
  };
  std::visit(Overloaded{
                 [&](const ListBodies&) {
                   reply.state = ControlState{desk_.bodies(), desk_.map_mode(),
                                              desk_.recording().value_or(""), desk_.recordings(),
                                              version_of(desk_.map().get())};
                 },
                 [&](const SetEnabled& c) { report(desk_.set_enabled(c.body_id, c.enabled)); },
                 [&](const Rename& c) { report(desk_.rename(c.body_id, c.name)); },
                 [&](const SetPivot& c) { report(desk_.set_pivot(c.body_id, c.X_BP)); },
                 [&](const SetMapMode& c) { report(desk_.set_map_mode(c.mode)); },
                 [&](const MapChange& c) { report(desk_.change_map(c)); },
                 [&](const StartRecording& c) { report(desk_.start_recording(c.name)); },
                 [&](const StopRecording&) { report(desk_.stop_recording()); },
             },
             command);
  return reply;
}

}  // namespace fiducap::native
