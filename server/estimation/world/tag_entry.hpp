#pragma once

#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/filter/corner_noise.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// A new tag joins the state where `camera` sees it, correlated with the camera, its own part of
/// the covariance from its corners.
/// @param X_VT  near its place, in the certain one of its two branches: the corners are linearised
/// here
void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen,
             const Pose& X_VT, const CornerNoise& noise);

/// A tag of the map joins with the map's covariance, as a tag that is used and not corrected.
void hold(FilterState& state, const KnownTag& known, Instant at);

/// The map says another place, or how well it is known, of a tag that is held: its marginal is
/// replaced, and what the rest of the state shares with it goes along. What was learned through the
/// tag stays learned, and being told the same again teaches nothing.
/// @return false, and nothing changed, when it stands too far away to be where it was: it was moved
[[nodiscard]] bool replace_held(FilterState& state, std::size_t tag, const KnownTag& now);

/// The tag of the state and the held one are the same: the body learns from the difference, the
/// held one does not (Schmidt).
void fuse_with_held(FilterState& state, std::size_t tag, std::size_t held);

/// Fuses what a survey says about a tag in the state.
void fuse_prior(FilterState& state, std::size_t tag, const KnownTag& prior);

}  // namespace fiducap::world
