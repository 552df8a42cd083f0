#pragma once

#include <vector>

#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// What the data alone know of a column of the state whose prior is (0, `prior_sigma`²): 1/σ².
[[nodiscard]] double information_of(const FilterState& state, int column, double prior_sigma);

/// Exchanges the prior of one column, whose mean is zero: a measurement of zero whose information
/// is the difference of both. What is known of held tags stays, p(tags); what changes is what
/// follows when they are known, p(rest | tags). So the body goes where it then stands among them:
/// of a map that is off as a whole, the column and the body share that error, and a body that moved
/// along with it would leave its tags behind.
///
/// @param camera  whose image corrected the state last
/// @param value   of the column, as estimated
void exchange_prior(FilterState& state, int camera, int column, double value, double from_sigma,
                    double to_sigma);

/// A column becomes less certain, and with it what hangs on it. Held tags keep what they know, and
/// what is closed keeps its prior: with a larger variance than that, the data would seem to know
/// less than nothing of it, and a moment later everything.
void widen(FilterState& state, int column, double sigma, const std::vector<int>& closed);

}  // namespace fiducap::world
