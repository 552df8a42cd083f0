#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "mapping/graph/graph_state.hpp"

namespace fiducap {

/// A component is what hangs together, in axes of its own; 0: in those of the workspace. Two that
/// are not joined may know the same tag, each in its own place.

/// X ← T X for all of it.
void move_component(int component, const Pose& T, GraphState& graph);

/// All of `from` becomes part of `into`, in whose axes T brings it; what was a tag of both is one
/// then, where `graph.tags` has it first. Segments keep their tags by other indices.
void merge_components(int from, int into, const Pose& T, GraphState& graph);

/// What is there twice, with the same id and epoch, is one, where `graph.tags` has it first.
void unite_tags(int component, GraphState& graph);

/// Tags that no segment has any more.
void forget_unseen_tags(GraphState& graph);

/// What no sighting binds to the most of a component any more gets axes of its own.
/// @param next  number of a component that is free
/// @return the same, after it
[[nodiscard]] int split_component(int component, int next, GraphState& graph);

/// Leaves out segments, and nodes that belong to no other. Where a chain is cut, its rest is a
/// chain of its own: what was known there of velocity and biases is lost. Tags stay.
/// @return the new number of each node that is left
std::vector<std::optional<std::size_t>> keep_segments(
    const std::function<bool(const GraphSegment&)>& is_kept, GraphState& graph);

/// Paths in components without a tag say nothing, and are nowhere. @return as keep_segments()
std::vector<std::optional<std::size_t>> forget_unbound_paths(GraphState& graph);

}  // namespace fiducap
