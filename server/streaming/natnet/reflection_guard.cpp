#include "streaming/natnet/reflection_guard.hpp"

#include <algorithm>

namespace fiducap::natnet {

ReflectionGuard::ReflectionGuard(std::uint64_t key)
    : key_{key, ~key}, tables_(std::make_unique<Tables>()) {}

ReflectionGuard::Acquaintance ReflectionGuard::heard(const Peer& from, std::size_t bytes,
                                                     Instant now) {
  Seen& seen = place_of(from);
  const bool known =
      seen.peer == from && seen.at_ns >= 0 && now - instant_from_ns(seen.at_ns) <= kAcquaintance;
  if (!known) {
    seen = {from, {}, 0};
    strangers_.give_back(static_cast<double>(bytes), kStrangerBytes_s, now);
  }
  seen.at_ns = to_ns(now);
  return {known, seen.version};
}

void ReflectionGuard::promise(const Peer& to, Bitstream version) {
  if (Seen& seen = place_of(to); seen.peer == to) seen.version = version;
}

bool ReflectionGuard::may_answer(const Peer& to, std::size_t bytes, bool stranger, Instant now) {
  if (to.is_loopback()) return true;
  const auto cost = static_cast<double>(bytes);
  auto& bucket = tables_->addresses[net::address_hash(key_, to) % kBuckets];
  if (!bucket.has(cost, kAddressBurst, kAddressBytes_s, now)) return false;
  if (stranger && !may_send_to_stranger(bytes, now)) return false;
  return bucket.take(cost, kAddressBurst, kAddressBytes_s, now);
}

bool ReflectionGuard::may_send_to_stranger(std::size_t bytes, Instant now) {
  return strangers_.take(static_cast<double>(bytes), kStrangerBurst, kStrangerBytes_s, now);
}

ReflectionGuard::Seen& ReflectionGuard::place_of(const Peer& peer) {
  return tables_->seen[net::peer_hash(key_, peer) % kSeen];
}

}  // namespace fiducap::natnet
