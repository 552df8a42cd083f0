#pragma once

#include "simulation/filter_run.hpp"
#include "simulation/truth_errors.hpp"

namespace fiducap {

/// Data solved for as a whole after the last image, as `fiducap replay --resolve` does it, compared
/// with the truth.
struct RefinedRun {
  FilterRun poses;  ///< `at`: images whose pose hangs together with the workspace; of the rest only
                    ///< frames are filled in.
  MapErrors map;
  bool is_at_rest{};  ///< The last solution came to an end.
};

/// @pre data has an IMU; choice.knowledge is A; `live`, `start` and what listens are not looked at
[[nodiscard]] RefinedRun run_refined(const EstimationData& data, const FilterChoice& choice);

}  // namespace fiducap
