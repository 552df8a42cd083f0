#pragma once

#include <span>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// One tag seen by one camera of a body, with its place in axes A.
struct SightedTag {
  const TagObservation* seen{};
  const CameraModel* camera{};
  Pose X_BV;
  Pose X_AT;
  double k1{0};  ///< Of the lens beyond the one by which the corners were undistorted.
};

/// Where a body stands when these tags stand where they are said to: least squares over all
/// corners, from `X_AB` on.
///
/// Gauss–Newton; tags that fit worse than `inlier_px` per corner coordinate do not take part, so
/// one wrong tag does no harm.
/// @return the start when nothing fits or the answer would leave its neighbourhood (1 m and rad
/// together)
[[nodiscard]] Pose resect(Pose X_AB, std::span<const SightedTag> tags, double inlier_px);

}  // namespace fiducap
