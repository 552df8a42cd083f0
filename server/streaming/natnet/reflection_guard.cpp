#include "streaming/natnet/reflection_guard.hpp"

#include <algorithm>

namespace fiducap::natnet {

ReflectionGuard::ReflectionGuard(std::uint64_t key) : key_(key), tables_(std::make_unique<Tables>()) {}

void ReflectionGuard::Bucket::flow(Instant now, double per_second) {
  const double waited_s = std::max(0.0, to_seconds(now - used_at));
  spent = std::max(0.0, spent - waited_s * per_second);
  used_at = now;
}

ReflectionGuard::Acquaintance ReflectionGuard::heard(const Peer& from, std::size_t bytes, Instant now) {
  Seen& seen = place_of(from);
  const bool known = seen.peer == from && seen.at_ns >= 0 && now - instant_from_ns(seen.at_ns) <= kAcquaintance;
  if (!known) {
    seen = {from, {}, 0};
    strangers_.flow(now, kStrangerBytes_s);
    strangers_.spent = std::max(0.0, strangers_.spent - static_cast<double>(bytes));
  }
  seen.at_ns = to_ns(now);
  return {known, seen.version};
}

void ReflectionGuard::promise(const Peer& to, Bitstream version) {
  if (Seen& seen = place_of(to); seen.peer == to) seen.version = version;
}

bool ReflectionGuard::may_answer(const Peer& to, std::size_t bytes, bool stranger, Instant now) {
  Bucket& bucket = tables_->addresses[hash(to.address) % kBuckets];
  bucket.flow(now, kAddressBytes_s);
  if (bucket.spent + static_cast<double>(bytes) > kAddressBurst) return false;
  if (stranger && !may_send_to_stranger(bytes, now)) return false;
  bucket.spent += static_cast<double>(bytes);
  return true;
}

bool ReflectionGuard::may_send_to_stranger(std::size_t bytes, Instant now) {
  strangers_.flow(now, kStrangerBytes_s);
  if (strangers_.spent + static_cast<double>(bytes) > kStrangerBurst) return false;
  strangers_.spent += static_cast<double>(bytes);
  return true;
}

std::uint64_t ReflectionGuard::hash(std::uint64_t value) const {
  // Finaliser of MurmurHash3 over value and key, twice: the places are never shown to anybody.
  std::uint64_t h = value ^ key_;
  for (int i = 0; i < 2; ++i) {
    h = (h ^ h >> 33) * 0xff51afd7ed558ccd;
    h = (h ^ h >> 33) * 0xc4ceb9fe1a85ec53;
    h ^= h >> 33;
    h += key_;
  }
  return h;
}

ReflectionGuard::Seen& ReflectionGuard::place_of(const Peer& peer) {
  return tables_->seen[hash(std::uint64_t{peer.address} << 16 | peer.port) % kSeen];
}

}  // namespace fiducap::natnet
