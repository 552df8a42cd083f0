#pragma once

#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

/// A tag enters the state at the pose its corners say (RCARS II-D4). What the paper does with a
/// large covariance and an update by the same corners is done in one step: the covariance of the
/// least squares pose, and, seen by another camera than camera 0, its share of both extrinsics.
void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen,
             const Pose& X_VT, double corner_noise_px);

/// Fuses survey knowledge about a tag in the state as a measurement of X_WT.
void fuse_prior(FilterState& state, std::size_t tag, const KnownTag& prior);

/// Pose of a tag of the state in W, and its covariance (position, rotation vector, both W axes).
[[nodiscard]] KnownTag tag_in_workspace(const FilterState& state, std::size_t tag);

}  // namespace fiducap::robocentric
