#include "streaming/natnet/reflection_guard.hpp"

#include <utility>

namespace fiducap::natnet {

ReflectionGuard::ReflectionGuard(std::uint64_t key, net::TrustedNetworks networks)
    : key_{key, ~key}, rule_(key_, std::move(networks)), tables_(std::make_unique<Tables>()) {}

ReflectionGuard::Acquaintance ReflectionGuard::heard(const Peer& from, std::size_t bytes,
                                                     Instant now) {
  if (!rule_.heard(from, bytes, now)) return {};
  Seen& seen = place_of(from);
  const bool known =
      seen.peer == from && seen.at_ns >= 0 && now - instant_from_ns(seen.at_ns) <= kAcquaintance;
  if (!known) seen = {from, {}, 0};
  seen.at_ns = to_ns(now);
  return {true, seen.version};
}

void ReflectionGuard::promise(const Peer& to, Bitstream version) {
  if (Seen& seen = place_of(to); seen.peer == to) seen.version = version;
}

bool ReflectionGuard::may_answer(const Peer& to, std::size_t bytes, bool trusted, Instant now) {
  if (to.is_loopback()) return true;
  if (!trusted) return rule_.may_answer_stranger(to, bytes);
  return tables_->addresses[net::address_hash(key_, to) % kBuckets].take(
      static_cast<double>(bytes), kAddressBurst, kAddressBytes_s, now);
}

bool ReflectionGuard::may_complain(const Peer& about, Instant now) {
  std::int64_t& at_ns = tables_->complained_ns[net::address_hash(key_, about) % kBuckets];
  if (at_ns != 0 && now - instant_from_ns(at_ns) < kComplaint) return false;
  at_ns = to_ns(now);
  return true;
}

ReflectionGuard::Seen& ReflectionGuard::place_of(const Peer& peer) {
  return tables_->seen[net::peer_hash(key_, peer) % kSeen];
}

}  // namespace fiducap::natnet
