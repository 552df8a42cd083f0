#pragma once

#include <span>

#include "estimation/filter/tag_measurement.hpp"
#include "estimation/world/filter_state.hpp"
#include "estimation/world/suspects.hpp"

namespace fiducap::world {

/// Whether what does not fit in an image speaks of noise of IMU and stamps: the camera's clock is
/// known and applied, so that its error is not taken for noise, and all tags are old.
/// @param tags  those that the image is corrected with
bool teaches_of_noise(const FilterState& state, int camera, std::span<const TagToUse> tags);

/// Without an IMU: keeps an image with so many tags from correcting lenses and print sizes, but for
/// lenses that shall be refined, if the image can tell of them. Until
/// FilterState::release_blocks().
void hold_sensors(FilterState& state, const Suspects& suspects, std::size_t tags);

}  // namespace fiducap::world
