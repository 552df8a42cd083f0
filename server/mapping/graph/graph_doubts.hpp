#pragma once

#include <cstddef>
#include <vector>

#include "estimation/found_mismatch.hpp"
#include "mapping/graph/graph_covariance.hpp"
#include "mapping/graph/graph_solution.hpp"
#include "mapping/graph/graph_state.hpp"
#include "mapping/graph/graph_terms.hpp"

namespace fiducap {

/// A number that the configuration calls exact: of a camera, of all prints, of one. The filters
/// doubt the same ones (world/suspects), each by what its own body has seen; here all bodies have a
/// say. Each stands in the equations with a prior so tight that it teaches the rest nothing; the
/// posterior shows what the data would say without (score test). One that is beyond 5 sigma is
/// opened: gets an honest prior instead.
struct DoubtedNumber {
  FoundMismatch::Kind kind{};
  std::size_t body{};  ///< Index, of a camera's number …
  int camera{-1};      ///< … else -1.
  std::size_t tag{};   ///< Index, of one print.
  int variable{};      ///< Where it stands in the equations …
  int row{};           ///< … and there.
  double value{};      ///< Against the configuration.
  Doubt doubt{};
};

[[nodiscard]] std::vector<DoubtedNumber> doubted_numbers(const GraphState& graph,
                                                         const GraphVariables& variables);
/// What its prior says of it, beside the GraphPrior.
[[nodiscard]] double prior_information(const DoubtedNumber& number);

/// Opens the one that is accused most, when that is enough, and closes those that turn out as
/// configured. A lens is opened as a whole.
/// @param covariance  of this graph, at rest
/// @param dispersion  squared errors over what was expected; 1: as they should be
/// @return whether there was something: it is not at rest any more
bool judge_doubts(const GraphCovariance& covariance, double dispersion, GraphState& graph);

/// What was opened and is known well enough to be told.
[[nodiscard]] std::vector<GraphFinding> findings_of(const GraphCovariance& covariance,
                                                    const GraphState& graph);

/// The priors of cameras' numbers are in GraphPrior from now on; of prints it knows nothing.
void fold_doubts(GraphState& graph);

}  // namespace fiducap
