#pragma once

#include <cstdint>
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

/// One of how many frames this profile gets; their numbers are the multiples of it.
[[nodiscard]] std::uint64_t step_of(const Profile& profile, double rate_hz);
/// Places in model.bodies of the bodies this profile gets, in order.
[[nodiscard]] std::vector<std::uint32_t> chosen_bodies(const Profile& profile,
                                                       const SceneModel& model);
/// `y-up mm, at most 50 Hz, 2 bodies`; for the operator.
[[nodiscard]] std::string text_of(const Profile& profile);

}  // namespace fiducap::native
