#pragma once

#include <vector>

#include "mapping/graph/graph_covariance.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/graph/graph_state.hpp"
#include "mapping/graph/graph_terms.hpp"

namespace fiducap {

// Terms of the parameters of cameras, tag sizes and gravity. Some of them are exact by
// configuration: readouts, lenses, the size of all tags, of one. The filters test the same ones
// with the data of their own body; here the data of all bodies are used. Each such parameter has a
// tight prior, without influence on the rest; the posterior gives the score test of the data alone.
// A parameter beyond 5 sigma is opened: it gets a wide prior instead.

/// Adds the priors that are in no segment and not in the GraphPrior.
void add_sensor_terms(const GraphState& graph, const GraphVariables& variables,
                      NormalEquations& out);

/// Opens the parameter with the highest score above the threshold, and closes one that turns out as
/// configured. A lens is opened as a whole.
/// @param covariance  of this graph, converged
/// @param dispersion  squared errors over their expectation; 1: as they should be
/// @return whether anything changed: the graph has to converge again
bool test_parameters(const GraphCovariance& covariance, double dispersion, GraphState& graph);

/// Open parameters that are known well enough to be reported.
[[nodiscard]] std::vector<GraphFinding> findings_of(const GraphCovariance& covariance,
                                                    const GraphState& graph);

/// From now on GraphPrior contains the priors of camera parameters; tag sizes are not in it.
void fold_tested_priors(GraphState& graph);

}  // namespace fiducap
