#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "base/time.hpp"

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
