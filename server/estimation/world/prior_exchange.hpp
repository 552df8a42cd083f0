#pragma once

#include <vector>

#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// What the data alone know of a column of the state whose prior is (0, `prior_sigma`²): 1/σ².
[[nodiscard]] double information_of(const FilterState& state, int column, double prior_sigma);

/// Exchanges the prior of one column, whose mean is zero: a measurement of zero whose information
/// is the difference of both. Held tags keep what they know.
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
