#pragma once

#include "estimation/world/filter_state.hpp"
#include "example_tags.hpp"

namespace fiducap::world {

/// A body with two cameras, three clones and three tags in front of camera 0, far from the origin,
/// nothing aligned with anything. Camera 0 is at its image; camera 1 has a rolling shutter and
/// a clock that is off. Lenses and prints are doubted, two prints are watched.
[[nodiscard]] FilterState example_state();

}  // namespace fiducap::world
