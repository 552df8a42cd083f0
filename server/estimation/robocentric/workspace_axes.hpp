#pragma once

#include "estimation/filter/heading_rule.hpp"
#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

/// Re-defines W by a tag in the state: its position and heading become exact by definition, up
/// stays gravity's business (`level`), or, without gravity, its whole pose becomes exact. Nothing
/// measurable changes.
/// @return X_WnewWold
Pose anchor_to_reference(FilterState& state, std::size_t tag, const HeadingRule& rule, bool level);

/// Re-defines W by a tag with a place in the map that camera `camera` sees at X_VT: mean from this
/// sighting, position and heading (without gravity: the whole attitude) unknown until the update
/// that follows.
/// @return X_WnewWold
Pose anchor_to_known(FilterState& state, int camera, const Pose& X_VT, const Pose& X_WT,
                     bool level);

/// The same by a tag of the state: mean from its estimate.
Pose anchor_local_to_known(FilterState& state, std::size_t tag, const Pose& X_WT, bool level);

}  // namespace fiducap::robocentric
