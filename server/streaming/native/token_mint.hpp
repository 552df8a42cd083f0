#pragma once

#include <array>
#include <cstdint>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::native {

using net::Peer;
using net::siphash;

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
  [[nodiscard]] std::uint64_t address_hash(const Peer& peer) const {
    return net::address_hash(key_, peer);
  }

 private:
  [[nodiscard]] std::uint64_t token_of_period(const Peer& peer, std::int64_t period) const;

  std::array<std::uint64_t, 2> key_;
  Duration period_;
};

}  // namespace fiducap::native
