#pragma once

#include <span>
#include <vector>

#include "estimation/robocentric/corner_update.hpp"
#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

/// Notes which tags an update accepted. A tag that keeps contradicting the others is gone from its place: it leaves the
/// state, and may join again like a new one. An update that accepts none blames no tag.
/// @return ids of the tags that left
[[nodiscard]] std::vector<int> keep_score(FilterState& state, std::span<const TagToUse> used,
                                          const std::vector<bool>& accepted, Instant at);

}  // namespace fiducap::robocentric
