#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"
#include "middleware/net/sender_rule.hpp"
#include "streaming/natnet/bitstream.hpp"
#include "streaming/net/limits.hpp"

namespace fiducap::natnet {

using net::Peer;

/// Keeps the server from being used against others. NatNet has no handshake: whoever can forge a
/// source address can ask in another's name, frames come for a lease, and answers are longer than
/// questions. So:
///
/// - Only addresses of trusted networks are clients.
/// - Any other address gets no frames, and what net::SenderRule allows of answers.
/// - One trusted address gets at most `kAddressBytes_s` of answers (frames do not count, their rate
///   is fixed). This machine's own addresses have no limit: nobody outside can ask in their name.
///
/// Fixed tables, keyed so that nobody can choose with whom he shares a place. Memory never grows.
class ReflectionGuard final {
 public:
  static constexpr double kAddressBytes_s = 64e3;
  static constexpr double kAddressBurst =
      1e6;  // 16 clients of one computer fetch 1000 bodies at once
  static constexpr Duration kAcquaintance = std::chrono::seconds(15);

  /// @param key  random for each start of the server
  ReflectionGuard(std::uint64_t key, net::TrustedNetworks networks);

  struct Acquaintance {
    bool trusted{};
    Bitstream version{};  ///< What it was promised when it connected; 0.0: it has not.
  };
  /// Counts a datagram that came. @return what is known of its sender
  Acquaintance heard(const Peer& from, std::size_t bytes, Instant now);
  /// Remembers what `heard` will say next.
  void promise(const Peer& to, Bitstream version);
  /// May these bytes go? Then they are counted.
  [[nodiscard]] bool may_answer(const Peer& to, std::size_t bytes, bool trusted, Instant now);
  /// Has this address's refusal not been said for a while? Then it counts as said.
  [[nodiscard]] bool may_complain(const Peer& about, Instant now);

 private:
  static constexpr Duration kComplaint = std::chrono::minutes(10);
  struct Seen {
    Peer peer;
    Bitstream version;
    std::int64_t at_ns{-1};
  };
  static constexpr std::size_t kSeen =
      16384;  // at 10 000 forged datagrams a second real ones still meet again
  static constexpr std::size_t kBuckets = 1024;
  struct Tables {
    std::array<Seen, kSeen> seen{};
    std::array<net::TokenBucket, kBuckets> addresses{};
    std::array<std::int64_t, kBuckets> complained_ns{};
  };

  [[nodiscard]] Seen& place_of(const Peer& peer);

  std::array<std::uint64_t, 2> key_;
  net::SenderRule rule_;
  std::unique_ptr<Tables> tables_;
};

}  // namespace fiducap::natnet
