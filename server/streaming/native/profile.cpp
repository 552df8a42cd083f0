#include "streaming/native/profile.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace fiducap::native {

std::uint64_t step_of(const Profile& profile, double rate_hz) {
  // A rate of 200.0001 Hz must not halve what a client of at most 100 Hz gets.
  constexpr double kTolerance = 1e-3;
  if (!(profile.max_rate_hz > 0) || !(rate_hz > profile.max_rate_hz)) return 1;
  const double step = std::ceil(rate_hz / static_cast<double>(profile.max_rate_hz) - kTolerance);
  return static_cast<std::uint64_t>(std::clamp(step, 1.0, 1e6));
}

std::vector<std::uint32_t> chosen_bodies(const Profile& profile, const SceneModel& model) {
  std::vector<std::uint32_t> chosen;
  for (std::size_t i = 0; i < model.bodies.size(); ++i) {
    const bool wanted =
        profile.bodies.empty() ||
        std::binary_search(profile.bodies.begin(), profile.bodies.end(), model.bodies[i].name);
    if (wanted) chosen.push_back(static_cast<std::uint32_t>(i));
  }
  return chosen;
}

std::string text_of(const Profile& profile) {
  std::string text =
      fmt::format("{} {}", name_of(profile.axes.up), profile.axes.units_per_m == 1.0 ? "m" : "mm");
  if (profile.axes.up != UpAxis::kZ && profile.axes.scope == AxesScope::kWorldAndBody)
    text += ", bodies turned";
  if (profile.max_rate_hz > 0) text += fmt::format(", at most {:g} Hz", profile.max_rate_hz);
  if (!profile.bodies.empty()) text += fmt::format(", {} chosen", profile.bodies.size());
  if (!profile.covariance) text += ", no covariance";
  return text;
}

}  // namespace fiducap::native
