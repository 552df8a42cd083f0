#pragma once

#include "estimation/filter/heading_rule.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// The same state in axes that stand elsewhere: X_new = G X for every pose. Errors turn with the
/// axes.
void move_axes(FilterState& state, const Pose& G);

/// Re-defines W by a tag in the state: its position and heading become exact by definition, up
/// stays gravity's business
/// (`level`), or, without gravity, its whole pose becomes exact. Nothing measurable changes.
/// @return X_WnewWold
Pose anchor_to_reference(FilterState& state, std::size_t tag, const HeadingRule& rule, bool level);

/// How far the tag's place and heading are from exact (m and rad together): what linearisation let
/// slip.
struct ReferenceSlack {
  double moved{};
  double sigma{};
};
[[nodiscard]] ReferenceSlack slack_of_reference(const FilterState& state, std::size_t tag,
                                                const HeadingRule& rule, bool level);

/// Re-defines W by a tag with a place in the map that `camera` sees at X_VT: mean from this
/// sighting; where the room is (position and heading; without gravity: the whole attitude) is
/// unknown until the update that follows.
/// @return X_WnewWold
Pose anchor_to_known(FilterState& state, int camera, const Pose& X_VT, const Pose& X_WT,
                     bool level);

/// The same by a tag of the state: mean from its estimate.
Pose anchor_local_to_known(FilterState& state, std::size_t tag, const Pose& X_WT, bool level);

/// The body's pose and velocity are unknown from here on, linearised at X_WB; biases, extrinsics
/// and tags stay.
void forget_motion(FilterState& state, const Pose& X_WB, bool has_imu);

}  // namespace fiducap::world
