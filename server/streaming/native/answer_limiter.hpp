#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "base/time.hpp"

namespace fiducap::native {

/// How often an address that holds no lease is answered: `kBurst` at once, then `kPerSecond`.
///
/// A fixed table; two addresses that fall on the same place share its budget. Memory never grows.
class AnswerLimiter final {
 public:
  static constexpr double kBurst = 64;  // all clients of a lab computer at once, after a restart
  static constexpr double kPerSecond = 32;

  /// @param address_hash  keyed, so that nobody can choose with whom he shares
  [[nodiscard]] bool allow(std::uint64_t address_hash, Instant now) {
    Bucket& bucket = buckets_[address_hash % kBuckets];
    const double waited_s = std::max(0.0, to_seconds(now - bucket.used_at));
    bucket.spent = std::max(0.0, bucket.spent - waited_s * kPerSecond);
    bucket.used_at = now;
    if (bucket.spent + 1 > kBurst) return false;
    bucket.spent += 1;
    return true;
  }

 private:
  static constexpr std::size_t kBuckets = 1024;
  struct Bucket {
    Instant used_at{};
    double spent{0};
  };
  std::array<Bucket, kBuckets> buckets_{};
};

}  // namespace fiducap::native
