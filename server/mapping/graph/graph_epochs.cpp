// What becomes of a map graph's segments when a tag has left its place.
#include <algorithm>

#include "estimation/filter/heading_rule.hpp"
#include "mapping/graph/graph_components.hpp"
#include "mapping/graph/map_graph.hpp"

namespace fiducap {

void MapGraph::follow(const EpochOrder& order) {
  const int last = epochs_.newest(order.tag_id);
  epochs_.follow(order);
  if (order.opens) {
    for (GraphSegment& entry : state_.segments) {
      const bool has_tag = std::any_of(entry.raw.tags.begin(), entry.raw.tags.end(),
                                       [&](const auto& t) { return t.tag_id == order.tag_id; });
      if (has_tag && entry.raw.end().at > order.opens->gone) bind_anew(entry);
    }
  } else {
    for (GraphTag& tag : state_.tags)
      if (tag.tag_id == order.tag_id && tag.epoch == last) --tag.epoch;
    std::set<int> components;
    for (const GraphTag& tag : state_.tags) components.insert(tag.component);
    for (const int component : components) unite_tags(component, state_);
  }
  drop_unbound(kInWorkspace);
}

void MapGraph::count_sightings() {
  for (GraphTag& tag : state_.tags) tag.sightings = tag.sightings_before;
  for (const GraphSegment& entry : state_.segments) count_sightings(entry);
}

void MapGraph::renumber_chains(const std::vector<std::optional<std::size_t>>& now) {
  for (auto& [body_id, chain] : chains_)
    if (chain.node) chain.node = now[*chain.node];
}

void MapGraph::replace_body(int body_id, std::vector<MotionSegment> segments) {
  renumber_chains(keep_segments(
      [&](const GraphSegment& segment) {
        const auto body = static_cast<std::size_t>(state_.nodes[segment.begin].body);
        return state_.bodies[body].id != body_id;
      },
      state_));
  chains_.erase(body_id);
  // What nobody else has seen is where the segments have it.
  forget_unseen_tags(state_);
  count_sightings();
  renumber_chains(forget_unbound_paths(state_));
  for (MotionSegment& segment : segments) (void)add(std::move(segment));
}

/// Its sightings are of other places than was thought, or of none.
void MapGraph::bind_anew(GraphSegment& entry) {
  MotionSegment raw = entry.raw;
  const std::vector<int> epochs = epochs_.sort(raw);
  auto factor = condense(raw);
  if (!factor) return;
  const GraphNode& begin = state_.nodes[entry.begin];
  const Pose G = axes_between(raw.begin().X_WB, begin.at.X_WB, raw.has_imu());
  entry.tags.clear();
  for (std::size_t i = 0; i < epochs.size(); ++i) {
    entry.tags.push_back(
        tag_of(begin.component, raw.tags[i], epochs[i], G * raw.tags[i].X_WT, raw.begin().at));
  }
  entry.raw = std::move(raw);
  entry.factor = std::move(*factor);
}

}  // namespace fiducap
