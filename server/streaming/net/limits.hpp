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

/// A budget for each address: so much at once, then so much per second.
class AddressLimiter {
 public:
  [[nodiscard]] bool allow(std::uint64_t address_hash, Instant now, double cost = 1) {
    return bucket(address_hash).take(cost, burst_, per_second_, now);
  }
  /// Would `allow` say yes?
  [[nodiscard]] bool has(std::uint64_t address_hash, Instant now) {
    return bucket(address_hash).has(1, burst_, per_second_, now);
  }

 protected:
  AddressLimiter(double burst, double per_second) : burst_(burst), per_second_(per_second) {}

 private:
  [[nodiscard]] TokenBucket& bucket(std::uint64_t address_hash) {
    return buckets_[address_hash % buckets_.size()];
  }

  double burst_;
  double per_second_;
  std::array<TokenBucket, 1024> buckets_{};
};

/// How often an address that has not proven itself is answered: `kBurst` at once, then
/// `kPerSecond`.
class AnswerLimiter final : public AddressLimiter {
 public:
  static constexpr double kBurst = 64;  // all clients of a lab computer at once, after a restart
  static constexpr double kPerSecond = 32;
  AnswerLimiter() : AddressLimiter(kBurst, kPerSecond) {}
};

/// How many requests of HTTP an address has answered: a page is a dozen, a program may ask ten
/// times a second, and behind one address there may be several of both.
class RequestLimiter final : public AddressLimiter {
 public:
  static constexpr double kBurst = 120;
  static constexpr double kPerSecond = 30;
  RequestLimiter() : AddressLimiter(kBurst, kPerSecond) {}
};

/// Who guesses tokens: after `kAllowed` wrong ones within `kWindow` an address is shut out for the
/// rest of it.
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
    return std::any_of(entries_.begin(), entries_.end(), [&](const Entry& entry) {
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
  /// Its own, else a free one, else that of whoever guessed least: nobody is shut out for another.
  [[nodiscard]] Entry& place_of(std::uint64_t address_hash, Instant now) {
    const auto rank = [&](const Entry& entry) {
      if (!is_fresh(entry, now)) return 0;
      return entry.address_hash == address_hash ? -1 : entry.count;
    };
    return *std::min_element(entries_.begin(), entries_.end(),
                             [&](const Entry& a, const Entry& b) { return rank(a) < rank(b); });
  }

  std::array<Entry, 256> entries_{};
};

}  // namespace fiducap::net
