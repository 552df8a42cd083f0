#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "base/time.hpp"
#include "streaming/native/peer.hpp"

namespace fiducap::native {

/// Keyed hash of short inputs. J.-P. Aumasson, D. J. Bernstein, "SipHash: a fast short-input PRF",
/// 2012 (SipHash-2-4).
[[nodiscard]] std::uint64_t siphash(const std::array<std::uint64_t, 2>& key,
                                    std::span<const std::uint8_t> data);

/// Tokens that only the owner of an address can know, without remembering anybody.
///
/// A token is a keyed hash of address, port and the current period. It is accepted in its own and
/// in the next period.
class TokenMint final {
 public:
  /// @param key  secret and random for each start of the server
  /// @pre period > 0
  TokenMint(const std::array<std::uint64_t, 2>& key, Duration period)
      : key_(key), period_(period) {}

  /// @return never 0
  [[nodiscard]] std::uint64_t token(const Peer& peer, Instant now) const;
  [[nodiscard]] bool accepts(std::uint64_t token, const Peer& peer, Instant now) const;
  /// Where a peer's address goes in a table that an attacker must not be able to steer. Ports do
  /// not matter, and of IPv6 only the network: one host owns all 2^64 addresses of its network.
  [[nodiscard]] std::uint64_t address_hash(const Peer& peer) const;

 private:
  [[nodiscard]] std::uint64_t token_of_period(const Peer& peer, std::int64_t period) const;

  std::array<std::uint64_t, 2> key_;
  Duration period_;
};

}  // namespace fiducap::native
