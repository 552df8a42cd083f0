#pragma once

#include <span>
#include <vector>

#include "estimation/start/resection.hpp"

namespace fiducap {

/// Squared norm of a sighting's eight numbers, in units of the noise, at which it pulls hardest: 5
/// sigma each (Cauchy loss).
inline constexpr double kSightingBend = 8 * 5.0 * 5.0;

/// One way in which two things may stand against each other.
struct CostedPose {
  Pose X;
  double cost{};
};

/// What sightings cost when a body stands at X_AB, by that loss.
[[nodiscard]] double misfit(std::span<const SightedTag> tags, const Pose& X_AB, double noise_px);
/// Where they cost least, near X_AB: first with what fits roughly, then with what fits.
[[nodiscard]] Pose improved(const Pose& X_AB, std::span<const SightedTag> tags, double noise_px);

/// Evenly out of all, when there are more.
template <typename T>
std::vector<T> thinned(const std::vector<T>& all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<T> out;
  for (std::size_t i = 0; i < most; ++i) out.push_back(all[i * all.size() / most]);
  return out;
}

}  // namespace fiducap
