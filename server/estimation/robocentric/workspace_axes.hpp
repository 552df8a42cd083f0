#pragma once

#include <optional>

#include "estimation/estimator_config.hpp"
#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

/// Which axis of the reference tag gives the heading, and where the tag shall stand. Fixed once chosen.
struct HeadingRule {
  int axis{0};           ///< 0 x, 1 y, 2 z of the tag: the most level one.
  double yaw_rad{0};     ///< Heading of that axis in W.
  Pose X_WT;             ///< Where the tag shall stand (position; without gravity: the whole pose).
};

/// @param q_WT  the tag's attitude in any level axes, to find its most level axis when the survey gives none
[[nodiscard]] HeadingRule make_heading_rule(const WorkspaceGauge& gauge, const Eigen::Quaterniond& q_WT);

/// Re-defines W by a tag in the state: its position and heading become exact by definition, up stays gravity's
/// business (`level`), or, without gravity, its whole pose becomes exact. Nothing measurable changes.
/// @return X_WnewWold
Pose tie_to_reference(FilterState& state, std::size_t tag, const HeadingRule& rule, bool level);

/// Re-defines W by a tag with a place in the map that camera `camera` sees at X_VT: mean from this sighting, position
/// and heading (without gravity: the whole attitude) unknown until the update that follows.
/// @return X_WnewWold
Pose tie_to_known(FilterState& state, int camera, const Pose& X_VT, const Pose& X_WT, bool level);

}  // namespace fiducap::robocentric
