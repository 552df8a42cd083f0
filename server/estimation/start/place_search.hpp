#pragma once

#include <optional>
#include <span>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// One tag seen by one camera of a body, with its pose in axes A.
struct SightedTag {
  const TagObservation* seen{};
  const CameraModel* camera{};
  Pose X_BV;
  Pose X_AT;
  double k1{0};  ///< Distortion beyond that of the lens used to undistort the corners.
};

/// The tag's corners are within five sigmas of their places by a pose of the body.
[[nodiscard]] bool fits(const SightedTag& tag, const Pose& X_AB, double corner_noise_px);

/// Pose of a body from tags at known poses: least squares over all corners, starting at `X_AB`.
///
/// Gauss–Newton; tags with residuals above `inlier_px` per corner coordinate are ignored.
/// @return the start when nothing fits or the solution is more than 1 (m and rad) away
[[nodiscard]] Pose resect(Pose X_AB, std::span<const SightedTag> tags, double inlier_px);

/// Prior of the body's pose in axes A.
struct PlaceGuess {
  Pose X_AB;
  double position_sigma_m{};
  double rotation_sigma_rad{};
};

/// The body's pose and its distinction from the next best one.
struct PlaceFound {
  Pose X_AB;
  double evidence{};  ///< Chi-square difference to the best clearly different pose; ∞: none.
  double misfit{};    ///< Chi-square per degree of freedom.
  double surprise{};  ///< Chi-square of the prior.
};

/// Rotation below which two poses are the same solution.
inline constexpr double kSamePlace_rad = 0.05;

/// Pose of the body from the tags of one image alone: each tag proposes two (planar) poses; the one
/// with the best fit of all tags and the prior is returned. Valid after any gap: not linearised.
/// @return nullopt when no tag proposes a possible pose
[[nodiscard]] std::optional<PlaceFound> find_place(std::span<const SightedTag> tags,
                                                   const PlaceGuess& guess, double corner_noise_px,
                                                   double same_rad = kSamePlace_rad);

}  // namespace fiducap
