#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// Numbers b = Lᵀ x of the state.
struct Numbers {
  Eigen::MatrixXd L;       ///< One column per number.
  Eigen::VectorXd values;  ///< As estimated.
};
/// Replaces the zero-mean priors of these numbers, at once: a measurement of zero with the
/// difference of information. The marginal of held tags p(tags) stays and p(rest | tags) changes,
/// so the body moves relative to them: an error of the whole map is common to number and body.
///
/// No direction of the numbers may be more uncertain than its prior; one that is, by rounding and
/// linearisation, has no information. All at once, as a correction turns the derivatives L.
/// @param camera  whose image corrected the state last
void exchange_priors(FilterState& state, int camera, const Numbers& numbers,
                     const Eigen::VectorXd& from_sigmas, const Eigen::VectorXd& to_sigmas);

/// Parameters that keep their variance: above its prior a closed one would have negative
/// information.
struct Closed {
  std::vector<int> columns;
  std::vector<int> mounts;  ///< Cameras.
};
/// Increases the variance of a number and what is correlated with it, but for held tags.
void widen(FilterState& state, const Eigen::VectorXd& l, double sigma, const Closed& closed);

}  // namespace fiducap::world
