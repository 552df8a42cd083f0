#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"

namespace fiducap::native {

/// How a client wants its frames; the default is everything in the server's own axes and metres.
struct Profile {
  OutputAxes axes;
  float max_rate_hz{0};  ///< 0: every frame.
  bool covariance{true};
  std::vector<std::string> bodies;  ///< Names, sorted, each once; empty: all.

  [[nodiscard]] bool operator==(const Profile& other) const {
    return axes.up == other.axes.up && axes.scope == other.axes.scope &&
           axes.units_per_m == other.axes.units_per_m && max_rate_hz == other.max_rate_hz &&
           covariance == other.covariance && bodies == other.bodies;
  }
  [[nodiscard]] bool is_default() const { return *this == Profile{}; }
};

/// A profile under the number that frames, models and leases carry; 0 is the default profile.
struct GrantedProfile {
  std::uint32_t number{};
  Profile profile;
};

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

/// One of how many frames this profile gets; their numbers are the multiples of it.
[[nodiscard]] std::uint64_t step_of(const Profile& profile, double rate_hz);
/// Places in model.bodies of the bodies this profile gets, in order.
[[nodiscard]] std::vector<std::uint32_t> chosen_bodies(const Profile& profile,
                                                       const SceneModel& model);
/// `y-up mm, at most 50 Hz, 2 bodies`; for the operator.
[[nodiscard]] std::string text_of(const Profile& profile);

}  // namespace fiducap::native
