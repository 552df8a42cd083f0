#pragma once

#include "simulation/filter_run.hpp"

namespace fiducap {

/// Data solved for as a whole after the last image, as `fiducap replay --resolve` does it, compared
/// with the truth.
struct RefinedRun {
  /// `at`: images whose pose is connected to the workspace; of the rest only frames are filled in.
  FilterRun poses;
  MapErrors map;
  bool is_at_rest{};  ///< The last solution came to an end.
};

/// @pre data has an IMU; choice.knowledge is A; `live`, `start` and callbacks are not used
[[nodiscard]] RefinedRun run_refined(const EstimationData& data, const FilterChoice& choice);

}  // namespace fiducap
