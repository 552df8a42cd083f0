#pragma once

#include <vector>

#include "mapping/graph/graph_covariance.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/graph/graph_state.hpp"
#include "mapping/graph/graph_terms.hpp"

namespace fiducap {

// Terms of the parameters of cameras, tag sizes and gravity. Those that are exact by configuration
// have a tight prior until a filter shows that they are wrong (CalibrationMonitor): then they have
// a wide one. Errors of the IMU are applied as the filter has them.

/// Adds the priors that are in no segment and not in the GraphPrior.
void add_sensor_terms(const GraphState& graph, const GraphVariables& variables,
                      NormalEquations& out);

/// Opens the parameters that the filter of the segment's body has found wrong, and closes those of
/// its sensors that it has not. @param body  index before all jumps of its clocks
void follow_filter(const MotionSegment& segment, std::size_t body, GraphState& graph);

/// Open parameters of lenses, shutters and tag sizes that differ significantly.
[[nodiscard]] std::vector<GraphFinding> findings_of(const GraphCovariance& covariance,
                                                    const GraphState& graph);

}  // namespace fiducap
