#pragma once

#include <optional>

#include "mapping/graph/graph_state.hpp"

namespace fiducap {

/// What the segments of the workspace, and the prior that there is, say of tags and cameras.
/// @pre the graph has come to rest
/// @return nullopt when something in it is not bound to anything
[[nodiscard]] std::optional<GraphPrior> prior_of(const GraphState& graph);

}  // namespace fiducap
