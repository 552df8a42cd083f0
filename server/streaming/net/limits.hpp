#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"

/// Limits against floods and guesses. Tables have a fixed size. Two addresses with the same slot
/// share it; the hashes are keyed, so a client cannot choose its slot.
namespace fiducap::net {

/// Token bucket: refills at a steady rate, refuses what exceeds the burst.
class TokenBucket final {
 public:
  [[nodiscard]] bool take(double cost, double burst, double per_second, Instant now) {
    if (!has(cost, burst, per_second, now)) return false;
    spent_ += cost;
    return true;
  }
  /// @return `take` would succeed
  [[nodiscard]] bool has(double cost, double burst, double per_second, Instant now) {
    flow(per_second, now);
    return spent_ + cost <= burst;
  }
  void give_back(double cost, double per_second, Instant now) {
    flow(per_second, now);
    spent_ = std::max(0.0, spent_ - cost);
  }

 private:
  void flow(double per_second, Instant now) {
    const double waited_s = std::max(0.0, to_seconds(now - used_at_));
    spent_ = std::max(0.0, spent_ - waited_s * per_second);
    used_at_ = now;
  }

  Instant used_at_{};
  double spent_{0};
};

/// A token bucket for each address.
template <int kMost, int kRefill>
class AddressLimiter final {
 public:
  static constexpr double kBurst = kMost;
  static constexpr double kPerSecond = kRefill;

  [[nodiscard]] bool allow(std::uint64_t address_hash, Instant now, double cost = 1) {
    return bucket(address_hash).take(cost, kBurst, kPerSecond, now);
  }
  /// @return `allow` would return true
  [[nodiscard]] bool has(std::uint64_t address_hash, Instant now) {
    return bucket(address_hash).has(1, kBurst, kPerSecond, now);
  }

 private:
  [[nodiscard]] TokenBucket& bucket(std::uint64_t address_hash) {
    return buckets_[address_hash % buckets_.size()];
  }

  std::array<TokenBucket, 1024> buckets_{};
};

/// Answers to an address that has not proven itself: all clients of a lab computer at once, after a
/// restart.
using AnswerLimiter = AddressLimiter<64, 32>;
/// HTTP requests of an address: a page needs a dozen, a program may send ten per second.
using RequestLimiter = AddressLimiter<120, 30>;

/// Wrong tokens per address: `kAllowed` within `kWindow` shut it out for the rest of the window.
class WrongProofs final {
 public:
  static constexpr int kAllowed = 5;
  static constexpr Duration kWindow = std::chrono::seconds(10);

  void note(std::uint64_t address_hash, Instant now) {
    Entry& entry = place_of(address_hash, now);
    if (entry.address_hash != address_hash || !is_fresh(entry, now)) entry = {address_hash, now, 0};
    ++entry.count;
  }
  [[nodiscard]] bool shut_out(std::uint64_t address_hash, Instant now) const {
    return std::ranges::any_of(entries_, [&](const Entry& entry) {
      return entry.address_hash == address_hash && entry.count >= kAllowed && is_fresh(entry, now);
    });
  }

 private:
  struct Entry {
    std::uint64_t address_hash{};
    Instant since{};
    int count{0};
  };

  [[nodiscard]] static bool is_fresh(const Entry& entry, Instant now) {
    return entry.count > 0 && now - entry.since < kWindow;
  }
  /// Its own entry, else a free one, else the one with the lowest count.
  [[nodiscard]] Entry& place_of(std::uint64_t address_hash, Instant now) {
    const auto rank = [&](const Entry& entry) {
      if (!is_fresh(entry, now)) return 0;
      return entry.address_hash == address_hash ? -1 : entry.count;
    };
    return *std::ranges::min_element(
        entries_, [&](const Entry& a, const Entry& b) { return rank(a) < rank(b); });
  }

  std::array<Entry, 256> entries_{};
};

/// The address with the most connections.
/// @return nullopt: no address has at least `least`
[[nodiscard]] inline std::optional<Peer> address_with_most_connections(
    std::span<const Peer> holders, std::ptrdiff_t least) {
  std::optional<Peer> found;
  for (const Peer& one : holders) {
    const auto has =
        std::ranges::count_if(holders, [&](const Peer& other) { return other.same_address(one); });
    if (has < least) continue;
    least = has + 1;
    found = one;
  }
  return found;
}

/// Whether a client gets one of a bounded number of places.
struct Place {
  bool is_there{};
  std::optional<Peer> instead_of{};  ///< The address that loses a place for it.
};

/// Places (at most half of all) that loopback always gets, from the remote address with the most:
/// an operator at the machine itself can always connect.
inline constexpr std::ptrdiff_t kOperatorPlaces = 4;

/// The rule for all places: connections, clients, pages, profiles. When all are taken, the address
/// with the most loses one to an address with at least two fewer.
/// @param holders  one entry per place taken   @param most  number of places
[[nodiscard]] inline Place place_for(const Peer& peer, std::span<const Peer> holders,
                                     std::size_t most) {
  if (holders.size() < most) return {true};
  if (peer.is_loopback()) {
    std::vector<Peer> remote;
    std::copy_if(holders.begin(), holders.end(), std::back_inserter(remote),
                 [](const Peer& one) { return !one.is_loopback(); });
    const auto local = std::ssize(holders) - std::ssize(remote);
    const auto reserved = std::min(kOperatorPlaces, static_cast<std::ptrdiff_t>(most + 1) / 2);
    if (local < reserved) {
      if (auto other = address_with_most_connections(remote, 1)) return {true, other};
    }
  }
  const auto same =
      std::ranges::count_if(holders, [&](const Peer& other) { return other.same_address(peer); });
  auto other = address_with_most_connections(holders, same + 2);
  return {other.has_value(), other};
}

}  // namespace fiducap::net
