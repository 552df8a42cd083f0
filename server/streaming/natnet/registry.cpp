#include "streaming/natnet/registry.hpp"

#include <algorithm>

namespace fiducap::natnet {

namespace {

constexpr std::size_t kMostFixed = 64;

bool is_client(const Subscriber& one) { return !one.stranger && !one.fixed; }

bool quieter(const Subscriber& one, const Subscriber& other) {
  return one.heard_at < other.heard_at;
}

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
  return by_default() &&
         std::all_of(bodies_.begin(), bodies_.end(), [](const auto& one) { return one.second; });
}

bool Selection::by_default() const {
  return rigid_bodies_.value_or(all_types_.value_or(!subscribed_only_));
}

Registry::Registry(const RegistryLimits& limits) : limits_(limits) {
  subscribers_.reserve(static_cast<std::size_t>(limits.max_clients + kMaxStrangers) + kMostFixed);
}

Subscriber* Registry::find(const Peer& peer) {
  const auto at = std::find_if(subscribers_.begin(), subscribers_.end(),
                               [&](const Subscriber& s) { return s.peer == peer; });
  return at == subscribers_.end() ? nullptr : &*at;
}

Subscriber* Registry::add(const Peer& peer, bool stranger, Instant now) {
  if (stranger) {
    drop_oldest_stranger();
  } else if (!make_place(peer, now)) {
    return nullptr;
  }
  Subscriber& added = subscribers_.emplace_back();
  added.peer = peer;
  added.stranger = stranger;
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

bool Registry::accept(Subscriber& stranger, Instant now) {
  const Peer peer = stranger.peer;
  if (!make_place(peer, now)) return false;
  find(peer)->stranger = false;  // looked up again: making a place may have moved it
  return true;
}

bool Registry::remove(const Peer& peer) {
  return std::erase_if(subscribers_,
                       [&](const Subscriber& s) { return s.peer == peer && !s.fixed; }) > 0;
}

std::size_t Registry::expire(Instant now) {
  std::erase_if(subscribers_, [&](const Subscriber& s) {
    return s.stranger && now - s.heard_at > kStrangerTimeout;
  });
  return std::erase_if(subscribers_, [&](const Subscriber& s) {
    return is_client(s) && now - s.heard_at > limits_.timeout;
  });
}

bool Registry::make_place(const Peer& peer, Instant now) {
  const auto of_address = [&](const Subscriber& s) {
    return is_client(s) && s.peer.same_address(peer);
  };
  const auto clients = std::count_if(subscribers_.begin(), subscribers_.end(), is_client);
  const auto here = std::count_if(subscribers_.begin(), subscribers_.end(), of_address);
  // Nobody can forge this machine's own address from outside.
  const bool full_here = !peer.is_loopback() && here >= limits_.max_clients_per_address;
  if (clients < limits_.max_clients && !full_here) return true;
  Subscriber* quietest = nullptr;
  for (Subscriber& s : subscribers_) {
    const bool may_go = full_here ? of_address(s) : is_client(s);
    if (may_go && (quietest == nullptr || quieter(s, *quietest))) quietest = &s;
  }
  if (quietest == nullptr || now - quietest->heard_at <= kReplaceableAfter) return false;
  return remove(quietest->peer);
}

void Registry::drop_oldest_stranger() {
  const auto is_stranger = [](const Subscriber& s) { return s.stranger; };
  if (std::count_if(subscribers_.begin(), subscribers_.end(), is_stranger) < kMaxStrangers) return;
  const auto oldest = std::find_if(subscribers_.begin(), subscribers_.end(), is_stranger);
  subscribers_.erase(oldest);  // they stand in the order they came
}

}  // namespace fiducap::natnet
