#pragma once

#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// A new tag joins the state where `camera` sees it, correlated with the camera, its own part of
/// the covariance from its corners.
/// @param X_VT  near its place, in the certain one of its two branches: the corners are linearised
/// here
void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen,
             const Pose& X_VT, double corner_noise_px);

/// A tag of the map joins with the map's covariance, as a tag that is used and not corrected.
void hold(FilterState& state, const KnownTag& known, Instant at);

/// Fuses what a survey says about a tag in the state.
void fuse_prior(FilterState& state, std::size_t tag, const KnownTag& prior);

}  // namespace fiducap::world
