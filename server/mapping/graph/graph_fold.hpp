#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "mapping/graph/graph_state.hpp"

namespace fiducap {

/// What the segments of the workspace, and the prior that there is, say of tags and cameras.
/// @pre the graph has come to rest
/// @return nullopt when something in it is not bound to anything
[[nodiscard]] std::optional<GraphPrior> prior_of(const GraphState& graph);

struct FoldedGraph {
  GraphState state;
  /// Where each node is now; nullopt: gone.
  std::vector<std::optional<std::size_t>> nodes;
};

/// Segments of the workspace are gone, and what they say is the prior. Every body begins anew where
/// it is: what was known of its biases is lost.
/// @param prior  as prior_of() has it
[[nodiscard]] FoldedGraph without_workspace_segments(GraphState graph, GraphPrior prior);

}  // namespace fiducap
