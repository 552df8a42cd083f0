#pragma once

#include <array>
#include <cstdint>

#include "base/time.hpp"

namespace fiducap::native {

/// Who guesses tokens: after `kAllowed` wrong ones within `kWindow` an address is shut out for the
/// rest of it.
///
/// A fixed table; two addresses that fall on the same place share it. Memory never grows.
class WrongProofs final {
 public:
  static constexpr int kAllowed = 5;
  static constexpr Duration kWindow = std::chrono::seconds(10);

  /// @param address_hash  keyed, so that nobody can choose with whom he shares
  void note(std::uint64_t address_hash, Instant now) {
    Entry& entry = entries_[address_hash % kEntries];
    if (entry.count == 0 || now - entry.since >= kWindow) entry = {now, 0};
    ++entry.count;
  }
  [[nodiscard]] bool shut_out(std::uint64_t address_hash, Instant now) const {
    const Entry& entry = entries_[address_hash % kEntries];
    return entry.count >= kAllowed && now - entry.since < kWindow;
  }

 private:
  static constexpr std::size_t kEntries = 256;
  struct Entry {
    Instant since{};
    int count{0};
  };
  std::array<Entry, kEntries> entries_{};
};

}  // namespace fiducap::native
