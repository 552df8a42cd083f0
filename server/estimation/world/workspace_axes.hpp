#pragma once

#include "estimation/filter/heading_rule.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// Expresses the state in other axes: X_new = G X for every pose; errors rotate with the axes.
void move_axes(FilterState& state, const Pose& G);

/// Adds an unknown motion of the whole workspace: one world-side error of the body, all cameras,
/// clones and tags.
void add_common_error(FilterState& state, const Matrix6d& covariance);

/// Redefines W by a tag in the state: its position and heading (`level`: the vertical comes from
/// gravity), or its whole pose, become exact. No measurable quantity changes.
/// @return X_WnewWold
Pose anchor_to_reference(FilterState& state, std::size_t tag, const HeadingRule& rule, bool level);

/// Deviation of the reference tag from its exact pose (m and rad together) due to linearisation.
struct ReferenceSlack {
  double moved{};
  double sigma{};
};
[[nodiscard]] ReferenceSlack slack_of_reference(const FilterState& state, std::size_t tag,
                                                const HeadingRule& rule, bool level);

/// Redefines W by a known tag that `camera` sees at X_VT: position and heading (not `level`: the
/// whole attitude) are uncertain until the next update.
/// @return X_WnewWold
Pose anchor_to_known(FilterState& state, int camera, const Pose& X_VT, const Pose& X_WT,
                     bool level);

/// The same by a tag of the state, at its estimated pose.
Pose anchor_local_to_known(FilterState& state, std::size_t tag, const Pose& X_WT, bool level);

/// Makes the body's pose and velocity unknown, linearised at X_WB; biases, extrinsics and tags
/// stay.
void forget_motion(FilterState& state, const Pose& X_WB, bool has_imu);

}  // namespace fiducap::world
