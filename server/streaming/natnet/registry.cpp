#include "streaming/natnet/registry.hpp"

#include <algorithm>

namespace fiducap::natnet {

namespace {

constexpr std::size_t kMostFixed = 64;

bool is_client(const Subscriber& one) { return !one.fixed; }

bool before(const std::pair<int, bool>& one, int id) { return one.first < id; }

}  // namespace

void Selection::body(int id, bool wanted) {
  const auto at = std::lower_bound(bodies_.begin(), bodies_.end(), id, before);
  if (at != bodies_.end() && at->first == id) {
    at->second = wanted;
  } else {
    bodies_.insert(at, {id, wanted});
  }
}

bool Selection::has(int id) const {
  const auto at = std::lower_bound(bodies_.begin(), bodies_.end(), id, before);
  return at != bodies_.end() && at->first == id ? at->second : by_default();
}

bool Selection::is_everything() const {
  return by_default() && std::ranges::all_of(bodies_, [](const auto& one) { return one.second; });
}

bool Selection::by_default() const {
  return rigid_bodies_.value_or(all_types_.value_or(!subscribed_only_));
}

Registry::Registry(const RegistryLimits& limits) : limits_(limits) {
  subscribers_.reserve(static_cast<std::size_t>(limits.max_clients) + kMostFixed);
}

Subscriber* Registry::find(const Peer& peer) {
  const auto at = std::ranges::find(subscribers_, peer, &Subscriber::peer);
  return at == subscribers_.end() ? nullptr : &*at;
}

Subscriber* Registry::add(const Peer& peer, Instant now) {
  if (!make_place(peer, now)) return nullptr;
  Subscriber& added = subscribers_.emplace_back();
  added.peer = peer;
  added.since = now;
  added.heard_at = now;
  return &added;
}

void Registry::add_fixed(const Peer& peer, Bitstream version, Instant now) {
  if (find(peer) != nullptr) return;
  Subscriber& added = subscribers_.emplace_back();
  added.peer = peer;
  added.name = "target";
  added.version = version;
  added.fixed = true;
  added.since = now;
}

bool Registry::remove(const Peer& peer) {
  return std::erase_if(subscribers_,
                       [&](const Subscriber& s) { return s.peer == peer && !s.fixed; }) > 0;
}

std::size_t Registry::expire(Instant now) {
  return std::erase_if(subscribers_, [&](const Subscriber& s) {
    return is_client(s) && now - s.heard_at > limits_.timeout;
  });
}

bool Registry::make_place(const Peer& peer, Instant now) {
  std::vector<Peer> clients;
  for (const Subscriber& s : subscribers_)
    if (is_client(s)) clients.push_back(s.peer);
  const auto here =
      std::ranges::count_if(clients, [&](const Peer& other) { return other.same_address(peer); });
  const net::Place place =
      net::place_for(peer, clients, static_cast<std::size_t>(limits_.max_clients));
  const bool full_here = !peer.is_loopback() && here >= limits_.max_clients_per_address;
  if (place.is_there && !place.instead_of && !full_here) return true;
  const Subscriber* silent =
      quietest([&](const Subscriber& s) { return !full_here || s.peer.same_address(peer); });
  if (silent != nullptr && now - silent->heard_at > kReplaceableAfter) return remove(silent->peer);
  if (full_here || !place.instead_of) return false;
  return remove(
      quietest([&](const Subscriber& s) { return s.peer.same_address(*place.instead_of); })->peer);
}

template <typename MayGo>
const Subscriber* Registry::quietest(MayGo may_go) const {
  const Subscriber* found = nullptr;
  for (const Subscriber& s : subscribers_)
    if (is_client(s) && may_go(s) && (found == nullptr || s.heard_at < found->heard_at)) found = &s;
  return found;
}

void QuietConnects::connected(const net::Peer& peer, Instant now) {
  heard(peer);
  if (asked_.size() == kMost) asked_.erase(asked_.begin());
  asked_.push_back({peer, now});
}

void QuietConnects::heard(const net::Peer& peer) {
  std::erase_if(asked_, [&](const Asked& one) { return one.peer == peer; });
}

std::optional<net::Peer> QuietConnects::next(Instant now) {
  if (asked_.empty() || now - asked_.front().at < kSilence) return std::nullopt;
  const net::Peer peer = asked_.front().peer;
  asked_.erase(asked_.begin());
  return peer;
}

ReflectionGuard::ReflectionGuard(std::uint64_t key, net::TrustedNetworks networks)
    : key_{key, ~key}, rule_(key_, std::move(networks)), tables_(std::make_unique<Tables>()) {}

ReflectionGuard::Sender ReflectionGuard::heard(const Peer& from, std::size_t bytes, Instant now) {
  if (!rule_.count_received(from, bytes, now)) return {};
  Seen& seen = place_of(from);
  const bool known =
      seen.peer == from && seen.at_ns >= 0 && now - instant_from_ns(seen.at_ns) <= kRemembered;
  if (!known) seen = {from, {}, 0};
  seen.at_ns = to_ns(now);
  return {true, seen.version};
}

void ReflectionGuard::set_version(const Peer& to, Bitstream version) {
  if (Seen& seen = place_of(to); seen.peer == to) seen.version = version;
}

bool ReflectionGuard::may_answer(const Peer& to, std::size_t bytes, bool trusted, Instant now) {
  if (to.is_loopback()) return true;
  if (!trusted) return rule_.may_answer_untrusted(to, bytes);
  return tables_->addresses[net::address_hash(key_, to) % kBuckets].take(
      static_cast<double>(bytes), kAddressBurst, kAddressBytes_s, now);
}

bool ReflectionGuard::may_warn(const Peer& about, Instant now) {
  std::int64_t& at_ns = tables_->warned_ns[net::address_hash(key_, about) % kBuckets];
  if (at_ns != 0 && now - instant_from_ns(at_ns) < kWarningPeriod) return false;
  at_ns = to_ns(now);
  return true;
}

ReflectionGuard::Seen& ReflectionGuard::place_of(const Peer& peer) {
  return tables_->seen[net::peer_hash(key_, peer) % kSeen];
}

}  // namespace fiducap::natnet
