#include "streaming/native/registry.hpp"

#include <algorithm>

namespace fiducap::native {

namespace {

// A token must outlive the lease it came with, and a slow first answer.
constexpr Duration kLeastTokenPeriod = std::chrono::seconds(10);
// A client asks again when a part of the model was lost; more often than this is not answered with the whole model.
constexpr Duration kModelPause = std::chrono::milliseconds(50);

std::string printable(std::string_view text) {
  std::string safe(text);
  for (char& c : safe) {
    if (c < ' ' || c > '~') c = '?';
  }
  return safe;
}

std::string_view sentence(NoticeReason reason) {
  switch (reason) {
    case NoticeReason::kServerFull: return "the server has all the clients it may have (streaming.native.max_clients)";
    case NoticeReason::kAddressFull:
      return "this address has all the clients it may have (streaming.native.max_clients_per_address)";
    case NoticeReason::kShuttingDown: return "the server ends";
  }
  return "";
}

}  // namespace

Registry::Registry(const RegistryLimits& limits, const std::array<std::uint64_t, 2>& key, std::uint64_t session)
    : limits_(limits), mint_(key, std::max(kLeastTokenPeriod, 2 * limits.lease)), session_(session) {
  subscribers_.reserve(static_cast<std::size_t>(limits.max_clients));
}

Registry::Reply Registry::receive(std::span<const std::byte> datagram, const Peer& from,
                                  std::uint64_t model_generation, Instant now) {
  const auto request = decode_request(datagram);
  if (!request) {
    ++unanswered_.malformed;
    return {};
  }
  if (const auto* subscribe = std::get_if<SubscribeRequest>(&*request)) {
    return on(*subscribe, from, model_generation, datagram.size(), now);
  }
  return on(std::get<UnsubscribeRequest>(*request), from, now);
}

Registry::Reply Registry::on(const SubscribeRequest& request, const Peer& from, std::uint64_t model_generation,
                             std::size_t bytes_in, Instant now) {
  if (!mint_.accepts(request.token, from, now)) return challenge(request, from, bytes_in, now);
  Subscriber* subscriber = find(from);
  Event event = Event::kNone;
  if (subscriber == nullptr) {
    if (!limiter_.allow(mint_.address_hash(from), now)) {
      ++unanswered_.too_often;
      return {};
    }
    expire(now);
    if (const auto reason = reason_to_refuse(from)) return refuse(request, *reason, bytes_in);
    subscriber = &subscribers_.emplace_back();
    subscriber->peer = from;
    subscriber->since = now;
    event = Event::kJoined;
  }
  subscriber->name = printable(request.client_name);
  subscriber->lease_until = now + limits_.lease;
  subscriber->lost_on_the_way = request.frames_lost;
  const bool send_model = request.model_generation != model_generation &&
                          (!subscriber->model_sent_at || now - *subscriber->model_sent_at >= kModelPause);
  if (send_model) subscriber->model_sent_at = now;
  return {encode(LeaseAnswer{session_, request.nonce, mint_.token(from, now), limits_.lease, model_generation}),
          send_model, event};
}

Registry::Reply Registry::on(const UnsubscribeRequest& request, const Peer& from, Instant now) {
  if (!mint_.accepts(request.token, from, now)) {
    ++unanswered_.malformed;
    return {};
  }
  const auto removed = std::erase_if(subscribers_, [&](const Subscriber& s) { return s.peer == from; });
  return {{}, false, removed > 0 ? Event::kLeft : Event::kNone};
}

Registry::Reply Registry::challenge(const SubscribeRequest& request, const Peer& from, std::size_t bytes_in,
                                    Instant now) {
  if (!limiter_.allow(mint_.address_hash(from), now)) {
    ++unanswered_.too_often;
    return {};
  }
  Datagram answer = encode(ChallengeAnswer{mint_.token(from, now), request.nonce, session_});
  if (answer.size() > bytes_in) return {};
  return {std::move(answer), false, Event::kNone};
}

std::optional<NoticeReason> Registry::reason_to_refuse(const Peer& from) const {
  if (subscribers_.size() >= static_cast<std::size_t>(limits_.max_clients)) return NoticeReason::kServerFull;
  const auto same = std::count_if(subscribers_.begin(), subscribers_.end(),
                                  [&](const Subscriber& s) { return s.peer.same_address(from); });
  if (same >= limits_.max_clients_per_address) return NoticeReason::kAddressFull;
  return std::nullopt;
}

Registry::Reply Registry::refuse(const SubscribeRequest& request, NoticeReason reason, std::size_t bytes_in) const {
  Datagram answer = encode_notice(session_, request.nonce, reason, sentence(reason));
  // The sentence is a courtesy: without it the notice is shorter than any question.
  if (answer.size() > bytes_in) answer = encode_notice(session_, request.nonce, reason, "");
  return {std::move(answer), false, Event::kNone};
}

std::size_t Registry::expire(Instant now) {
  return std::erase_if(subscribers_, [&](const Subscriber& s) { return s.lease_until <= now; });
}

Subscriber* Registry::find(const Peer& peer) {
  const auto at = std::find_if(subscribers_.begin(), subscribers_.end(),
                               [&](const Subscriber& s) { return s.peer == peer; });
  return at == subscribers_.end() ? nullptr : &*at;
}

}  // namespace fiducap::native
