#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "streaming/native/profile.hpp"

namespace fiducap::native {

/// The different profiles in use, at most kMost of them. The default profile is always there and
/// does not count.
class ProfileTable final {
 public:
  static constexpr std::size_t kMost = 16;

  /// @return its number; nullopt when the table is full
  [[nodiscard]] std::optional<std::uint32_t> grant(const Profile& profile) {
    if (profile.is_default()) return 0;
    for (const auto& known : profiles_) {
      if (known.profile == profile) return known.number;
    }
    if (profiles_.size() == kMost) return std::nullopt;
    profiles_.push_back({++last_number_, profile});
    return last_number_;
  }
  /// Forgets the profiles that nobody uses. @param is_used  of a number
  template <typename IsUsed>
  void prune(IsUsed&& is_used) {
    std::erase_if(profiles_, [&](const GrantedProfile& known) { return !is_used(known.number); });
  }
  /// Without the default one.
  [[nodiscard]] std::span<const GrantedProfile> profiles() const { return profiles_; }

 private:
  std::vector<GrantedProfile> profiles_;
  std::uint32_t last_number_{0};  // never used twice: a late frame of an old profile is nobody's
};

}  // namespace fiducap::native
