#pragma once

#include <cmath>
#include <map>

#include "base/so3.hpp"
#include "mapping/refinement.hpp"
#include "mapping/refinement_residuals.hpp"

namespace fiducap {

/// How far a bundle adjustment may be from the truth, said by its own corners: normalised
/// estimation error squared.
///
/// Σ over all sightings |J e|² / σ² is eᵀ Λ e with Λ the Fisher information at the truth and e the
/// error of all poses and tags. An estimate that reaches the Cramér–Rao bound makes it chi-square
/// with `numbers` degrees of freedom, whatever the geometry; directions that no corner sees (the
/// gauge) cost nothing.
struct BundleNees {
  double value{};
  int numbers{};

  /// Distance from the expectation in standard deviations of chi-square.
  [[nodiscard]] double sigmas() const { return (value - numbers) / std::sqrt(2.0 * numbers); }
};

/// @param gauge_freedom  6 when nothing of the estimate was held, else 0
inline BundleNees bundle_nees(const RefinementProblem& problem,
                              const std::vector<KnownTag>& true_tags,
                              const std::vector<Pose>& true_X_WB, const std::vector<KnownTag>& tags,
                              const std::vector<Pose>& X_WB, int gauge_freedom = 0) {
  const auto error = [](const Pose& estimate, const Pose& truth) {
    Eigen::Matrix<double, 6, 1> e;
    e << estimate.p - truth.p, log_so3(estimate.q * truth.q.conjugate());
    return e;
  };
  std::map<int, Eigen::Matrix<double, 6, 1>> tag_errors;
  std::map<int, const KnownTag*> truth;
  for (const KnownTag& tag : true_tags) {
    truth[tag.tag_id] = &tag;
    tag_errors[tag.tag_id].setZero();
  }
  int moved_tags = 0;
  for (const KnownTag& tag : tags) {
    tag_errors[tag.tag_id] = error(tag.X_WT, truth.at(tag.tag_id)->X_WT);
    moved_tags += tag_errors[tag.tag_id].isZero(0) ? 0 : 1;  // one that was held is not estimated
  }
  BundleNees nees;
  nees.numbers = 6 * static_cast<int>(X_WB.size()) + 6 * moved_tags - gauge_freedom;
  for (std::size_t i = 0; i < X_WB.size(); ++i) {
    const Eigen::Matrix<double, 6, 1> body_error = error(X_WB[i], true_X_WB[i]);
    for (const TagObservations& image : problem.frames[i].images) {
      const CameraMount& camera = problem.cameras[static_cast<std::size_t>(image.camera)];
      for (const TagObservation& seen : image.tags) {
        const SightingResidual at =
            sighting_residual(seen, camera, true_X_WB[i], truth.at(seen.tag_id)->X_WT);
        const Vector8d moved = at.d_body * body_error + at.d_tag * tag_errors[seen.tag_id];
        nees.value += moved.squaredNorm() / (problem.corner_noise_px * problem.corner_noise_px);
      }
    }
  }
  return nees;
}

}  // namespace fiducap
