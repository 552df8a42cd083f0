#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "streaming/net/limits.hpp"
#include "streaming/net/networks.hpp"
#include "streaming/net/peer.hpp"

namespace fiducap::net {

/// The rule for datagrams of clients that prove nothing, whatever protocol they speak: addresses of
/// trusted networks are believed; any other gets at most three times the bytes that came in its
/// name.
class SenderRule final {
 public:
  /// @param key  random for each start of the server
  SenderRule(const std::array<std::uint64_t, 2>& key, TrustedNetworks networks)
      : key_(key), networks_(std::move(networks)) {}

  /// Counts a datagram that came. @return its sender's address is believed
  bool heard(const Peer& from, std::size_t bytes, Instant now) {
    if (networks_.contains(from, now)) return true;
    strangers_.heard(address_hash(key_, from), bytes);
    return false;
  }
  /// May these bytes go to an address that is not believed? Then they are counted.
  [[nodiscard]] bool may_answer_stranger(const Peer& to, std::size_t bytes) {
    return strangers_.take(address_hash(key_, to), bytes);
  }

 private:
  std::array<std::uint64_t, 2> key_;
  TrustedNetworks networks_;
  AnswerBudget strangers_;
};

}  // namespace fiducap::net
