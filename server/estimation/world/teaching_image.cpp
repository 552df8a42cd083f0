#include "estimation/world/teaching_image.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap::world {

namespace {

constexpr double kClockKnown_s = 0.003;
constexpr double kClockApplied_s = 0.003;
constexpr int kSightingsToBeOld = 10;

bool is_clock_known(const FilterState& state, int camera) {
  const CameraClock& clock = state.clocks[static_cast<std::size_t>(camera)];
  const double variance = state.P()(layout::clock(camera), layout::clock(camera));
  return std::abs(clock.seconds_to(0)) < kClockApplied_s &&
         variance < kClockKnown_s * kClockKnown_s;
}

/// A tag that has just joined shares the body's error: against it, the motion shows no noise.
bool is_old(const FilterState& state, const TagToUse& tag) {
  if (tag.local < 0) return true;
  const WorldTag& own = state.tags[static_cast<std::size_t>(tag.local)];
  return own.held || own.sightings >= kSightingsToBeOld;
}

}  // namespace

bool teaches_of_noise(const FilterState& state, int camera, std::span<const TagToUse> tags) {
  return is_clock_known(state, camera) &&
         std::all_of(tags.begin(), tags.end(),
                     [&](const TagToUse& tag) { return is_old(state, tag); });
}

}  // namespace fiducap::world
