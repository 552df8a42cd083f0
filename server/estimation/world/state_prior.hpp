#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// Replaces the zero-mean prior of one number b = ℓᵀ x of the state: a measurement of zero with the
/// difference of information. The marginal of held tags p(tags) stays and p(rest | tags) changes,
/// so the body moves relative to them: an error of the whole map is common to number and body.
/// @param camera  whose image corrected the state last
/// @param value   of b, as estimated
void exchange_prior(FilterState& state, int camera, const Eigen::VectorXd& l, double value,
                    double from_sigma, double to_sigma);

/// Parameters that keep their variance: above its prior a closed one would have negative
/// information.
struct Closed {
  std::vector<int> columns;
  std::vector<int> mounts;  ///< Cameras.
};
/// Increases the variance of a number and what is correlated with it, but for held tags.
void widen(FilterState& state, const Eigen::VectorXd& l, double sigma, const Closed& closed);

}  // namespace fiducap::world
