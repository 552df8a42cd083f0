#include "mapping/graph/graph_components.hpp"

#include <algorithm>
#include <numeric>
#include <set>

namespace fiducap {

namespace {

/// Variables of a component that segments, or the prior, bind to each other.
class Islands final {
 public:
  Islands(const GraphState& graph, int component)
      : nodes_(graph.nodes.size()), parent_(nodes_ + graph.tags.size()) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    for (const GraphSegment& segment : graph.segments) {
      if (graph.nodes[segment.begin].component != component) continue;
      join(segment.begin, segment.end);
      for (const std::size_t i : segment.tags) join(segment.begin, nodes_ + i);
    }
    for (const std::size_t i : graph.prior.tags)
      join(nodes_ + graph.prior.tags.front(), nodes_ + i);
  }
  [[nodiscard]] std::size_t of_node(std::size_t i) { return root(i); }
  [[nodiscard]] std::size_t of_tag(std::size_t i) { return root(nodes_ + i); }

 private:
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) { parent_[root(a)] = root(b); }

  std::size_t nodes_;
  std::vector<std::size_t> parent_;
};

/// Nodes that belong to no segment go, with the starts of their chains.
std::vector<std::optional<std::size_t>> forget_bare_nodes(GraphState& graph) {
  std::vector<std::optional<std::size_t>> now(graph.nodes.size());
  for (const GraphSegment& segment : graph.segments) now[segment.begin] = now[segment.end] = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    if (!now[i]) continue;
    now[i] = count;
    graph.nodes[count++] = graph.nodes[i];
  }
  graph.nodes.resize(count);
  for (GraphSegment& segment : graph.segments) {
    segment.begin = *now[segment.begin];
    segment.end = *now[segment.end];
  }
  std::erase_if(graph.starts, [&](const ChainStart& start) { return !now[start.node]; });
  for (ChainStart& start : graph.starts) {
    start.node = *now[start.node];
    if (start.after < 0) continue;
    const auto after = now[static_cast<std::size_t>(start.after)];
    start.after = after ? static_cast<int>(*after) : -1;
  }
  return now;
}

/// Of a chain that begins with this segment because what was before it is gone.
ChainStart start_of(const GraphSegment& segment, const GraphState& graph) {
  const GraphNode& node = graph.nodes[segment.begin];
  ChainStart out{.node = segment.begin, .has_imu = segment.raw.has_imu()};
  if (!out.has_imu && graph.level.at(node.component))  // odometry knows up
    out.up_B = node.at.X_WB.q.conjugate() * Eigen::Vector3d::UnitZ();
  return out;
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

void unite_tags(int component, GraphState& graph) {
  std::vector<GraphTag> kept;
  std::map<std::pair<int, int>, std::size_t> numbers;  // by id and epoch, of the component's
  std::vector<std::size_t> now(graph.tags.size());
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    const GraphTag& tag = graph.tags[i];
    now[i] = kept.size();
    if (tag.component == component)
      now[i] = numbers.try_emplace({tag.tag_id, tag.epoch}, kept.size()).first->second;
    if (now[i] == kept.size()) {
      kept.push_back(tag);
      continue;
    }
    GraphTag& one = kept[now[i]];
    if (tag.print.is_open && !one.print.is_open) {
      one.print = tag.print;
      one.scale = tag.scale;
    }
    one.sightings += tag.sightings;
    one.sightings_before += tag.sightings_before;
    one.first_seen = std::min(one.first_seen, tag.first_seen);
    one.last_seen = std::max(one.last_seen, tag.last_seen);
  }
  graph.tags = std::move(kept);
  graph.prior.renumber(now);
  for (GraphSegment& segment : graph.segments)
    for (std::size_t& i : segment.tags) i = now[i];
}

void forget_unseen_tags(GraphState& graph) {
  std::vector<bool> is_seen(graph.tags.size());
  for (const GraphSegment& segment : graph.segments)
    for (const std::size_t i : segment.tags) is_seen[i] = true;
  for (const std::size_t i : graph.prior.tags) is_seen[i] = true;
  std::vector<std::size_t> now(graph.tags.size());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    now[i] = kept;
    if (is_seen[i]) graph.tags[kept++] = graph.tags[i];
  }
  graph.tags.resize(kept);
  graph.prior.renumber(now);
  for (GraphSegment& segment : graph.segments)
    for (std::size_t& i : segment.tags) i = now[i];
}

int split_component(int component, int next, GraphState& graph) {
  Islands islands(graph, component);
  std::map<std::size_t, int> sightings;  // by island
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    if (graph.tags[i].component == component)
      sightings[islands.of_tag(i)] += graph.tags[i].sightings;
  }
  if (sightings.empty()) return next;
  const auto most =
      std::max_element(sightings.begin(), sightings.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  std::map<std::size_t, int> numbers{{most->first, component}};
  const auto number_of = [&](std::size_t island) {
    const auto [at, is_new] = numbers.try_emplace(island, next);
    if (is_new) graph.level[next++] = graph.level.at(component);
    return at->second;
  };
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    if (graph.tags[i].component == component)
      graph.tags[i].component = number_of(islands.of_tag(i));
  }
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    if (graph.nodes[i].component == component)
      graph.nodes[i].component = number_of(islands.of_node(i));
  }
  return next;
}

std::vector<std::optional<std::size_t>> keep_segments(
    const std::function<bool(const GraphSegment&)>& is_kept, GraphState& graph) {
  std::erase_if(graph.segments, [&](const GraphSegment& segment) { return !is_kept(segment); });
  const auto now = forget_bare_nodes(graph);
  std::set<std::size_t> bound;  // nodes of whose velocity and biases something is known
  for (const ChainStart& start : graph.starts) bound.insert(start.node);
  for (const GraphSegment& segment : graph.segments) bound.insert(segment.end);
  for (const GraphSegment& segment : graph.segments)
    if (!bound.contains(segment.begin)) graph.starts.push_back(start_of(segment, graph));
  return now;
}

std::vector<std::optional<std::size_t>> forget_unbound_paths(GraphState& graph) {
  std::set<int> bound;
  for (const GraphTag& tag : graph.tags) bound.insert(tag.component);
  return keep_segments(
      [&](const GraphSegment& s) { return bound.contains(graph.nodes[s.begin].component); }, graph);
}

}  // namespace fiducap
