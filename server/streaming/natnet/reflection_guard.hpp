#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "base/time.hpp"
#include "streaming/natnet/bitstream.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/net/peer.hpp"

namespace fiducap::natnet {

using net::Peer;

/// Keeps the server from being used against others. NatNet has no handshake: whoever can forge a
/// source address can ask in another's name, and answers are longer than questions. So:
///
/// - An address and port that was heard only once is a stranger. All strangers together get no more
/// bytes than they
///   sent plus `kStrangerBytes_s`. Real clients speak twice within a second.
/// - One address gets at most `kAddressBytes_s` of answers (frames do not count, their rate is
/// fixed). This machine's
///   own addresses have no limit: nobody outside can ask in their name.
///
/// Fixed tables, keyed so that nobody can choose with whom he shares a place. Memory never grows.
class ReflectionGuard final {
 public:
  static constexpr double kStrangerBytes_s = 32e3;
  static constexpr double kStrangerBurst =
      128e3;  // one full MODELDEF for a client that asks nothing else first
  static constexpr double kAddressBytes_s = 64e3;
  static constexpr double kAddressBurst =
      1e6;  // 16 clients of one computer fetch 1000 bodies at once
  static constexpr Duration kAcquaintance = std::chrono::seconds(15);

  /// @param key  random for each start of the server
  explicit ReflectionGuard(std::uint64_t key);

  /// What is remembered of one that was heard before.
  struct Acquaintance {
    bool known{};
    Bitstream version{};  ///< What it was promised when it connected; 0.0: it has not.
  };
  /// Counts a datagram that came. @return what was known of its sender before it
  Acquaintance heard(const Peer& from, std::size_t bytes, Instant now);
  /// Remembers what `heard` will say next.
  void promise(const Peer& to, Bitstream version);
  /// May these bytes go? Then they are counted.
  [[nodiscard]] bool may_answer(const Peer& to, std::size_t bytes, bool stranger, Instant now);
  /// The same for a frame.
  [[nodiscard]] bool may_send_to_stranger(std::size_t bytes, Instant now);

 private:
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
  };

  [[nodiscard]] Seen& place_of(const Peer& peer);

  std::array<std::uint64_t, 2> key_;
  net::TokenBucket strangers_;
  std::unique_ptr<Tables> tables_;
};

}  // namespace fiducap::natnet
