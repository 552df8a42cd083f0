#include "estimation/world/teaching_image.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap::world {

namespace {

constexpr double kClockKnown_s = 0.003;
constexpr double kClockApplied_s = 0.003;
constexpr int kSightingsToBeOld = 10;
// Without an IMU, images with fewer tags teach nothing about lenses: what one tag alone shows of
// its tilt is no straight line, and the lens would be bent to make it one.
constexpr std::size_t kTagsToSeeALens = 3;

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

void hold_sensors(FilterState& state, const Suspects& suspects, std::size_t tags) {
  if (!state.has_suspects()) return;
  state.hold_block(layout::sizes(state.cameras()));
  for (int c = 0; c < state.cameras(); ++c) {
    if (tags < kTagsToSeeALens || !suspects.is_refined(c)) state.hold_block(layout::clock(c));
  }
}

}  // namespace fiducap::world
