// How a map graph removes segments, and binds them to tags again that were moved.
#include <algorithm>
#include <set>
#include <utility>

#include "estimation/filter/heading_rule.hpp"
#include "mapping/graph/graph_covariance.hpp"
#include "mapping/graph/graph_state.hpp"
#include "mapping/graph/map_graph.hpp"

namespace fiducap {

namespace {

/// The information of the workspace's segments, and of the present prior, about tags and cameras.
/// Segments of other components are kept as they are, so they must not count here.
std::optional<GraphPrior> prior_of(const GraphState& graph) {
  const auto covariance = GraphCovariance::of(graph, kInWorkspace);
  if (!covariance) return std::nullopt;
  const Eigen::MatrixXd columns = covariance->camera_columns();
  PriorCameras cameras;
  cameras.covariance.resize(columns.cols(), columns.cols());
  Eigen::Index at = 0;
  for (std::size_t b = 0; b < graph.bodies.size(); ++b) {
    cameras.bodies.push_back(graph.bodies[b].cameras);
    const Eigen::MatrixXd rows = covariance->camera_rows(columns, b);
    cameras.covariance.middleRows(at, rows.rows()) = rows;
    at += rows.rows();
  }
  std::vector<PriorTag> tags;
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    if (graph.tags[i].component != kInWorkspace) continue;
    tags.push_back({i, graph.tags[i].X_WT, *covariance->between(i, i), false});
    cameras.of_tags.push_back(covariance->tag_rows(columns, i));
  }
  const auto bound = bound_tags(graph);
  const auto between = [&](std::size_t a, std::size_t b) -> std::optional<Matrix6d> {
    const auto [first, second] = std::minmax(tags[a].tag, tags[b].tag);
    if (!bound.contains({first, second})) return std::nullopt;
    return covariance->between(tags[a].tag, tags[b].tag);
  };
  const PriorUnknown relative =
      graph.level.at(kInWorkspace) ? PriorUnknown::kPlaceAndYaw : PriorUnknown::kPlaceAndTurn;
  return make_prior(tags, between, cameras,
                    graph.prior.is_absolute ? PriorUnknown::kNothing : relative);
}

/// Of a component with this many tags: bounds memory (0.2 MB a segment) and the time of a solution
/// by the size of the place, for sessions of any length.
std::size_t most_segments(std::size_t tags) {
  constexpr std::size_t kFew = 150;
  constexpr std::size_t kPerTag = 6;
  constexpr std::size_t kMost = 2000;
  return std::min(kFew + kPerTag * tags, kMost);
}

}  // namespace

/// Folds the segments of the workspace. Of other components, and of a workspace that does not
/// converge, the oldest half is removed.
void MapGraph::keep_bounded(bool is_converged) {
  std::map<int, std::size_t> segments;
  std::map<int, std::size_t> tags;
  for (const GraphSegment& segment : state_.segments) ++segments[component_of(segment)];
  for (const GraphTag& tag : state_.tags) ++tags[tag.component];
  for (const auto& entry : segments) {
    const int component = entry.first;
    const std::size_t count = entry.second;
    const std::size_t most = most_segments(tags[component]);
    const bool is_placed = component == kInWorkspace;
    if (is_placed && is_converged) {
      if (count > most) fold();
    } else if (count > (is_placed ? 2 * most : most)) {
      std::size_t oldest = count / 2;
      const auto is_kept = [&](const GraphSegment& segment) {
        if (oldest == 0 || component_of(segment) != component) return true;
        --oldest;
        return false;
      };
      renumber_chains(keep_segments(is_kept, state_));
      drop_unbound(component);
    }
  }
}

void MapGraph::fold() {
  auto prior = prior_of(state_);
  if (!prior) return;
  renumber_chains(keep_segments(
      [&](const GraphSegment& segment) { return component_of(segment) != kInWorkspace; }, state_));
  state_.prior = std::move(*prior);
  for (GraphTag& tag : state_.tags)
    if (tag.component == kInWorkspace) tag.sightings_before = tag.sightings;
}

/// After segments were unbound from tags, or removed from a component.
void MapGraph::drop_unbound(int component) {
  forget_unseen_tags(state_);
  count_sightings();
  // The workspace is 0; new ones are counted from 1.
  components_ = split_component(component, components_ + 1, state_) - 1;
  renumber_chains(forget_unbound_paths(state_));
}

void MapGraph::follow(const EpochOrder& order) {
  const int last = epochs_.newest(order.tag_id);
  epochs_.follow(order);
  if (order.opens) {
    for (GraphSegment& entry : state_.segments) {
      const bool has_tag = std::ranges::any_of(
          entry.raw.tags, [&](const auto& t) { return t.tag_id == order.tag_id; });
      if (!has_tag || entry.raw.end().at <= order.opens->gone) continue;
      MotionSegment raw = entry.raw;
      const std::vector<int> epochs = epochs_.sort(raw);
      auto factor = condense(raw);
      if (!factor) continue;
      const GraphNode& begin = state_.nodes[entry.begin];
      const Pose G = axes_between(raw.begin().X_WB, begin.at.X_WB, raw.has_imu());
      entry.raw = std::move(raw);
      entry.factor = std::move(*factor);
      bind_tags(G, epochs, entry);
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
  // A tag of this body alone starts at the estimate of the new segments.
  forget_unseen_tags(state_);
  count_sightings();
  renumber_chains(forget_unbound_paths(state_));
  for (MotionSegment& segment : segments) (void)add(std::move(segment));
}

}  // namespace fiducap
