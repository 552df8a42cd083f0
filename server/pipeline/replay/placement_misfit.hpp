#pragma once

#include <span>

#include "estimation/start/resection.hpp"

namespace fiducap {

/// Squared norm of a sighting's eight numbers, in units of the noise, at which it pulls hardest: 5
/// sigma each (Cauchy loss).
inline constexpr double kSightingBend = 8 * 5.0 * 5.0;

/// What sightings cost when a body stands at X_AB, by that loss.
[[nodiscard]] double misfit(std::span<const SightedTag> tags, const Pose& X_AB, double noise_px);
/// Where they cost least, near X_AB: first with what fits roughly, then with what fits.
[[nodiscard]] Pose improved(const Pose& X_AB, std::span<const SightedTag> tags, double noise_px);

}  // namespace fiducap
