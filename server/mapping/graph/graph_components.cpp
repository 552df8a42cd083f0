#include "mapping/graph/graph_components.hpp"

#include <algorithm>

namespace fiducap {

namespace {

void unite_tags(int component, GraphState& graph) {
  std::vector<GraphTag> kept;
  std::map<int, std::size_t> numbers;  // by id, of the component's
  std::vector<std::size_t> now(graph.tags.size());
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    const GraphTag& tag = graph.tags[i];
    now[i] = kept.size();
    if (tag.component == component)
      now[i] = numbers.try_emplace(tag.tag_id, kept.size()).first->second;
    if (now[i] == kept.size()) {
      kept.push_back(tag);
      continue;
    }
    GraphTag& one = kept[now[i]];
    one.sightings += tag.sightings;
    one.first_seen = std::min(one.first_seen, tag.first_seen);
    one.last_seen = std::max(one.last_seen, tag.last_seen);
  }
  graph.tags = std::move(kept);
  graph.prior.renumber(now);
  for (GraphSegment& segment : graph.segments)
    for (std::size_t& i : segment.tags) i = now[i];
}

}  // namespace

void move_component(int component, const Pose& T, GraphState& graph) {
  for (GraphNode& node : graph.nodes)
    if (node.component == component) node.at = in_other_axes(T, node.at);
  for (GraphTag& tag : graph.tags)
    if (tag.component == component) tag.X_WT = T * tag.X_WT;
  if (component == kInWorkspace) graph.prior.move(T);
}

void merge_components(int from, int into, const Pose& T, GraphState& graph) {
  move_component(from, T, graph);
  for (GraphNode& node : graph.nodes)
    if (node.component == from) node.component = into;
  for (GraphTag& tag : graph.tags)
    if (tag.component == from) tag.component = into;
  graph.level[into] = graph.level[into] || graph.level[from];
  graph.level.erase(from);
  unite_tags(into, graph);
}

}  // namespace fiducap
