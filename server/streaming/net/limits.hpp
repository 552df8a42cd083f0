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
#include "streaming/net/peer.hpp"

/// Limits against floods and guesses. Fixed tables, memory never grows: two addresses that fall on
/// the same place share it, and their hashes are keyed, so that nobody can choose with whom.
namespace fiducap::net {

/// What was spent flows off at a steady rate; what would rise above the burst is refused.
class TokenBucket final {
 public:
  [[nodiscard]] bool take(double cost, double burst, double per_second, Instant now) {
    if (!has(cost, burst, per_second, now)) return false;
    spent_ += cost;
    return true;
  }
  /// Would `take` succeed?
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

/// How often an address that has not proven itself is answered: `kBurst` at once, then
/// `kPerSecond`.
class AnswerLimiter final {
 public:
  static constexpr double kBurst = 64;  // all clients of a lab computer at once, after a restart
  static constexpr double kPerSecond = 32;

  [[nodiscard]] bool allow(std::uint64_t address_hash, Instant now) {
    return buckets_[address_hash % buckets_.size()].take(1, kBurst, kPerSecond, now);
  }

 private:
  std::array<TokenBucket, 1024> buckets_{};
};

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

/// The address that holds the most places, and at least `least` of them; it gives one up when all
/// are taken and somebody with at least two fewer wants one, so that nobody keeps others out.
[[nodiscard]] inline std::optional<Peer> greediest_address(std::span<const Peer> holders,
                                                           std::ptrdiff_t least) {
  std::optional<Peer> greediest;
  for (const Peer& one : holders) {
    const auto has = std::count_if(holders.begin(), holders.end(),
                                   [&](const Peer& other) { return other.same_address(one); });
    if (has < least) continue;
    least = has + 1;
    greediest = one;
  }
  return greediest;
}

/// Whether somebody gets one of a bounded number of places.
struct Place {
  bool is_there{};
  std::optional<Peer> instead_of{};  ///< The address that gives one up for it.
};

/// The operator can always get in from the machine itself: with fewer places than this (and than
/// half of all), loopback is given one by whoever else has the most.
inline constexpr std::ptrdiff_t kOperatorPlaces = 4;

/// The one rule for places, whatever they are: connections, clients, pages, profiles.
/// @param holders  who has one, an entry for each   @param most  places there are
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
      if (auto other = greediest_address(remote, 1)) return {true, other};
    }
  }
  const auto same = std::count_if(holders.begin(), holders.end(),
                                  [&](const Peer& other) { return other.same_address(peer); });
  auto greediest = greediest_address(holders, same + 2);
  return {greediest.has_value(), greediest};
}

/// Who guesses tokens: after `kAllowed` wrong ones within `kWindow` an address is shut out for the
/// rest of it.
class WrongProofs final {
 public:
  static constexpr int kAllowed = 5;
  static constexpr Duration kWindow = std::chrono::seconds(10);

  void note(std::uint64_t address_hash, Instant now) {
    Entry& entry = entries_[address_hash % entries_.size()];
    if (entry.count == 0 || now - entry.since >= kWindow) entry = {now, 0};
    ++entry.count;
  }
  [[nodiscard]] bool shut_out(std::uint64_t address_hash, Instant now) const {
    const Entry& entry = entries_[address_hash % entries_.size()];
    return entry.count >= kAllowed && now - entry.since < kWindow;
  }

 private:
  struct Entry {
    Instant since{};
    int count{0};
  };
  std::array<Entry, 256> entries_{};
};

}  // namespace fiducap::net
