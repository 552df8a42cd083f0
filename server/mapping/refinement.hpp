#pragma once

#include <optional>
#include <vector>

#include "base/expected.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// One instant of one body: where it is thought to be, and what its cameras saw.
struct RefinementFrame {
  Pose X_WB;
  std::vector<TagObservations> images;  ///< `camera` is an index into RefinementProblem::cameras.
};

/// Images, tags and what is known of the tags. Units SI, noises 1-sigma.
struct RefinementProblem {
  std::vector<CameraMount> cameras;  ///< Lens and X_BV are taken as exact.
  std::vector<RefinementFrame> frames;
  std::vector<KnownTag> fixed;      ///< Inputs: never moved. Their covariance is not looked at.
  std::vector<KnownTag> estimated;  ///< Start poses; the covariance is not looked at.
  /// Survey knowledge of estimated tags: X_WT with a positive definite covariance. Other ids are
  /// passed over.
  std::vector<KnownTag> priors;
  double corner_noise_px{0.4};
  /// Held where it starts when there is neither a fixed tag nor a prior; nullopt or unseen: the
  /// first seen one.
  std::optional<int> gauge_tag;
};

struct RefinementResult {
  std::vector<KnownTag>
      tags;  ///< `estimated`, in its order, moved. The covariance is the one that came in.
  std::vector<Pose> X_WB;  ///< One per frame, in their order.
  double initial_cost{};  ///< Half the sum of the robust squares; every term in units of its noise.
  double final_cost{};
  int iterations{};
};

/// Bundle adjustment: the body and tag poses that explain all corners and the survey best.
///
/// Minimises over all sightings the corner residuals of RCARS II-D4 (raw pixels, white noise) and
/// over all priors their Mahalanobis distance. A sighting counts through a Cauchy loss that bends
/// at 5 sigma per corner coordinate, so a wrong id or a wrong planar branch in the start hardly
/// pulls; priors are believed as stated. Levenberg–Marquardt, frames eliminated first (Schur).
/// Keeps nothing, no threads, the same input gives the same answer. A local method: what lies in
/// another basin stays there. Sightings of tags that are neither fixed nor estimated are passed
/// over; a tag without view and without prior stays where it is.
/// @return Error when there is nothing to do (no sighting of a known or estimated tag) or a number
/// cannot be (camera
///         out of range, an id twice, a pose that is not finite, a prior without a positive
///         definite covariance)
[[nodiscard]] Expected<RefinementResult> refine(const RefinementProblem& problem);

}  // namespace fiducap
