#include "streaming/natnet/quiet_connects.hpp"

namespace fiducap::natnet {

void QuietConnects::asked(const net::Peer& peer, Instant now) {
  heard(peer);
  if (asked_.size() == kMost) asked_.erase(asked_.begin());
  asked_.push_back({peer, now});
}

void QuietConnects::heard(const net::Peer& peer) {
  std::erase_if(asked_, [&](const Asked& one) { return one.peer == peer; });
}

std::optional<net::Peer> QuietConnects::next(Instant now) {
  if (asked_.empty() || now - asked_.front().at < kPatience) return std::nullopt;
  const net::Peer peer = asked_.front().peer;
  asked_.erase(asked_.begin());
  return peer;
}

}  // namespace fiducap::natnet
