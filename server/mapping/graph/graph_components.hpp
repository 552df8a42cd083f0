#pragma once

#include <optional>
#include <span>

#include "estimation/known_tag.hpp"
#include "mapping/graph/graph_state.hpp"

namespace fiducap {

/// A component is what hangs together, in axes of its own; 0: in those of the workspace. Two that
/// are not joined may know the same tag, each in its own place.

/// X ← T X for all of it.
void move_component(int component, const Pose& T, GraphState& graph);

/// What lays the corners of the workspace's tags over those of the same tags as they are given;
/// upright when gravity is felt. @return nullopt: it has none of them
[[nodiscard]] std::optional<Pose> axes_of_given(std::span<const KnownTag> given,
                                                const GraphState& graph);

/// All of `from` becomes part of `into`, in whose axes T brings it; what was a tag of both is one
/// then, where `graph.tags` has it first. Segments keep their tags by other indices.
void merge_components(int from, int into, const Pose& T, GraphState& graph);

}  // namespace fiducap
