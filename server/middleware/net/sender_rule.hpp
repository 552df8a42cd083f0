#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/time.hpp"
#include "middleware/net/networks.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::net {

/// What may be answered to an address that anybody can forge: at most `kRatio` times the bytes that
/// came in its name, whatever was asked and how often.
class AnswerBudget final {
 public:
  static constexpr double kRatio = 3;
  static constexpr double kMostSaved = 16384;

  void heard(std::uint64_t address_hash, std::size_t bytes) {
    double& saved = saved_[address_hash % saved_.size()];
    saved = std::min(kMostSaved, saved + kRatio * static_cast<double>(bytes));
  }
  [[nodiscard]] bool take(std::uint64_t address_hash, std::size_t bytes) {
    double& saved = saved_[address_hash % saved_.size()];
    if (static_cast<double>(bytes) > saved) return false;
    saved -= static_cast<double>(bytes);
    return true;
  }

 private:
  std::array<double, 1024> saved_{};
};

/// The rule for datagrams of senders that prove nothing, whatever protocol they speak: addresses of
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
