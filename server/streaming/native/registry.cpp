#include "streaming/native/registry.hpp"

#include <algorithm>
#include <iterator>
#include <limits>

#include <fmt/format.h>

#include "base/text.hpp"

namespace fiducap::native {

namespace {

template <typename T>
std::uint8_t* put(std::uint8_t* at, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i)
    *at++ = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i));
  return at;
}

// A token must outlive its lease and a slow first reply.
constexpr Duration kLeastTokenPeriod = std::chrono::seconds(10);
// Least time between two models for a client, which asks again when a part was lost.
constexpr Duration kModelPause = std::chrono::milliseconds(50);

/// By NoticeReason, from 1.
constexpr std::array<std::string_view, 5> kSentences{
    "the server has its maximum of clients (streaming.native.max_clients)",
    "this address has its maximum of clients (streaming.native.max_clients_per_address)",
    "the server ends",
    "the server already encodes 16 different profiles (axes, unit, rate, bodies): use one of "
    "another "
    "client",
    "the profile (axes, unit, rate, bodies) has values this server does not know"};
static_assert(kSentences.size() == static_cast<std::size_t>(NoticeReason::kProfileInvalid));

}  // namespace

std::uint64_t TokenIssuer::token(const Peer& peer, Instant now) const {
  return token_of_period(peer, to_ns(now) / period_.count());
}

bool TokenIssuer::accepts(std::uint64_t token, const Peer& peer, Instant now) const {
  const std::int64_t period = to_ns(now) / period_.count();
  return token == token_of_period(peer, period) || token == token_of_period(peer, period - 1);
}

std::uint64_t TokenIssuer::token_of_period(const Peer& peer, std::int64_t period) const {
  std::array<std::uint8_t, 30> input{};
  auto* at = std::copy(peer.address.begin(), peer.address.end(), input.data());
  at = put(at, peer.scope);
  at = put(at, peer.port);
  put(at, period);
  return std::max<std::uint64_t>(1, siphash(key_, input));
}

Registry::Registry(const RegistryLimits& limits, const std::array<std::uint64_t, 2>& key,
                   std::uint64_t session)
    : limits_(limits),
      tokens_(key, std::max(kLeastTokenPeriod, 2 * limits.lease)),
      session_(session) {
  subscribers_.reserve(static_cast<std::size_t>(limits.max_clients));
}

Registry::Reply Registry::receive(std::span<const std::byte> datagram, const Peer& from,
                                  std::uint64_t model_generation, Instant now) {
  const auto request = decode_request(datagram);
  if (!request) return {};
  const Sender sender{from, datagram.size(), model_generation, now};
  return std::visit([&](const auto& what) { return on(what, sender); }, *request);
}

Registry::Reply Registry::on(const SubscribeRequest& request, const Sender& sender) {
  const auto& [from, bytes_in, model_generation, now] = sender;
  if (!tokens_.accepts(request.token, from, now)) return challenge(request, sender);
  if (!request.profile) return refuse(request, NoticeReason::kProfileInvalid, bytes_in);
  std::optional<Peer> instead_of;
  const bool joins = find(from) == nullptr;
  if (joins) {
    if (!limiter_.allow(tokens_.address_hash(from), now)) return {};
    expire(now);
    if (const auto reason = make_room(from, instead_of)) return refuse(request, *reason, bytes_in);
  }
  const auto profile = grant(*request.profile, from, instead_of);
  if (!profile) return refuse(request, NoticeReason::kProfilesFull, bytes_in);
  if (joins) {
    Subscriber& newcomer = subscribers_.emplace_back();
    newcomer.peer = from;
    newcomer.since = now;
  }
  Reply reply = renew(*find(from), request, *profile, sender);
  reply.event = joins ? Event::kJoined : Event::kNone;
  reply.instead_of = instead_of;
  return reply;
}

Registry::Reply Registry::renew(Subscriber& subscriber, const SubscribeRequest& request,
                                std::uint32_t profile, const Sender& sender) {
  const Instant now = sender.now;
  const bool another_profile = subscriber.profile != profile;
  const bool model_is_due =
      !subscriber.model_sent_at || now - *subscriber.model_sent_at >= kModelPause;
  if (another_profile && !model_is_due) {  // it asks again: limits the encoding load
    prune_profiles();
    return {};
  }
  subscriber.name = printable(request.client_name, kMaxClientName);
  subscriber.lease_until = now + limits_.lease;
  subscriber.report = request.report;
  subscriber.profile = profile;
  subscriber.multicast = request.multicast && group_.port != 0;
  if (another_profile) prune_profiles();
  const bool send_model =
      (another_profile || request.model_generation != sender.model_generation) && model_is_due;
  if (send_model) subscriber.model_sent_at = now;
  const LeaseAnswer lease{session_,
                          request.nonce,
                          tokens_.token(subscriber.peer, now),
                          limits_.lease,
                          sender.model_generation,
                          profile,
                          subscriber.multicast ? group_ : MulticastGroup{},
                          subscriber.datagrams.frames_dropped()};
  return {encode(lease), send_model, profile};
}

void Registry::prune_profiles() {
  profiles_.prune([&](std::uint32_t number) {
    return std::ranges::any_of(subscribers_,
                               [number](const Subscriber& s) { return s.profile == number; });
  });
}

Registry::Reply Registry::on(const ClockRequest& request, const Sender& sender) {
  const auto& [from, bytes_in, model_generation, now] = sender;
  if (!tokens_.accepts(request.token, from, now) || find(from) == nullptr) return {};
  return {encode_clock(session_, request.number, now)};
}

Registry::Reply Registry::on(const DiscoveryRequest& request, const Sender& sender) {
  if (!card_ || !discovery_limiter_.allow(tokens_.address_hash(sender.from), sender.now)) return {};
  Datagram answer = encode_discovery(request.nonce, session_, *card_);
  if (answer.size() > sender.bytes_in) return {};
  return {std::move(answer)};
}

Registry::Reply Registry::on(const UnsubscribeRequest& request, const Sender& sender) {
  if (!tokens_.accepts(request.token, sender.from, sender.now)) return {};
  const auto removed =
      std::erase_if(subscribers_, [&](const Subscriber& s) { return s.peer == sender.from; });
  prune_profiles();
  return {{}, false, 0, removed > 0 ? Event::kLeft : Event::kNone};
}

Registry::Reply Registry::challenge(const SubscribeRequest& request, const Sender& sender) {
  const auto& [from, bytes_in, model_generation, now] = sender;
  if (!limiter_.allow(tokens_.address_hash(from), now)) return {};
  Datagram answer = encode_challenge(tokens_.token(from, now), request.nonce, session_);
  if (answer.size() > bytes_in) return {};
  return {std::move(answer)};
}

std::optional<NoticeReason> Registry::make_room(const Peer& from, std::optional<Peer>& instead_of) {
  std::vector<Peer> holders;
  for (const Subscriber& s : subscribers_) holders.push_back(s.peer);
  const auto same =
      std::ranges::count_if(holders, [&](const Peer& other) { return other.same_address(from); });
  if (same >= limits_.max_clients_per_address) return NoticeReason::kAddressFull;
  const auto place = net::place_for(from, holders, static_cast<std::size_t>(limits_.max_clients));
  if (!place.is_there) return NoticeReason::kServerFull;
  if (place.instead_of)
    instead_of =
        forget_newest([&](const Subscriber& s) { return s.peer.same_address(*place.instead_of); });
  return std::nullopt;
}

/// The client that requested it first.
std::optional<Peer> Registry::holder_of(std::uint32_t profile) const {
  const auto first = std::ranges::find(subscribers_, profile, &Subscriber::profile);
  return first == subscribers_.end() ? std::nullopt : std::optional(first->peer);
}

std::uint32_t Registry::spare_profile_of(const Peer& address) const {
  std::uint32_t spare = 0;
  auto fewest = std::numeric_limits<std::ptrdiff_t>::max();
  for (const auto& granted : profiles_.profiles()) {
    const auto holder = holder_of(granted.number);
    if (!holder || !holder->same_address(address)) continue;
    const auto others = std::ranges::count_if(subscribers_, [&](const Subscriber& s) {
      return s.profile == granted.number && !s.peer.same_address(address);
    });
    if (others > fewest) continue;
    fewest = others;
    spare = granted.number;  // of equal ones the newest: numbers ascend
  }
  return spare;
}

std::optional<std::uint32_t> Registry::grant(const Profile& profile, const Peer& from,
                                             std::optional<Peer>& instead_of) {
  if (const auto number = profiles_.grant(profile)) return number;
  std::vector<Peer> holders;
  for (const auto& granted : profiles_.profiles())
    if (const auto holder = holder_of(granted.number)) holders.push_back(*holder);
  const auto place = net::place_for(from, holders, holders.size());
  if (!place.instead_of) return std::nullopt;
  const std::uint32_t spare = spare_profile_of(*place.instead_of);
  while (const auto gone = forget_newest([&](const Subscriber& s) { return s.profile == spare; }))
    instead_of = gone;
  return profiles_.grant(profile);
}

template <typename MayGo>
std::optional<Peer> Registry::forget_newest(MayGo&& may_go) {
  const auto newest = std::find_if(subscribers_.rbegin(), subscribers_.rend(), may_go);
  if (newest == subscribers_.rend()) return std::nullopt;
  const Peer gone = newest->peer;
  subscribers_.erase(std::next(newest).base());
  prune_profiles();
  return gone;
}

Registry::Reply Registry::refuse(const SubscribeRequest& request, NoticeReason reason,
                                 std::size_t bytes_in) const {
  Datagram answer = encode_notice(session_, request.nonce, reason,
                                  kSentences[static_cast<std::size_t>(reason) - 1]);
  // Without the sentence the notice is shorter than any request.
  if (answer.size() > bytes_in) answer = encode_notice(session_, request.nonce, reason, "");
  return {std::move(answer)};
}

std::size_t Registry::expire(Instant now) {
  const auto gone =
      std::erase_if(subscribers_, [&](const Subscriber& s) { return s.lease_until <= now; });
  if (gone > 0) prune_profiles();
  return gone;
}

Subscriber* Registry::find(const Peer& peer) {
  const auto at = std::ranges::find(subscribers_, peer, &Subscriber::peer);
  return at == subscribers_.end() ? nullptr : &*at;
}

RegistryLimits limits_of(const NativeConfig& config) {
  return {config.max_clients, config.max_clients_per_address, from_seconds(config.lease_s)};
}

ClientStatus status_of(const Subscriber& subscriber, const Profile& profile, Instant now) {
  const ClientReport& report = subscriber.report;
  std::string text =
      (subscriber.name.empty() ? "unnamed" : subscriber.name) + ", " + text_of(profile);
  if (subscriber.multicast) text += ", multicast";
  if (report.latency_p99 > Duration{0})
    text += fmt::format(", latency p99 {:.1f} ms", 1e3 * to_seconds(report.latency_p99));
  if (report.frames_lost > 0)
    text += fmt::format(", reports {} frames lost on the way", report.frames_lost);
  std::optional<ClockOffset> clock;
  if (report.clock_sigma > Duration{0})
    clock = ClockOffset{to_seconds(report.clock_offset), to_seconds(report.clock_sigma)};
  return {"native",
          net::text_of(subscriber.peer) + " udp",
          std::move(text),
          subscriber.datagrams.frames_sent(),
          subscriber.datagrams.frames_dropped(),
          to_seconds(now - subscriber.since),
          clock};
}

}  // namespace fiducap::native
