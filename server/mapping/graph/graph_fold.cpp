// How a map graph gives up segments.
#include <algorithm>
#include <utility>

#include "mapping/graph/graph_components.hpp"
#include "mapping/graph/graph_covariance.hpp"
#include "mapping/graph/graph_doubts.hpp"
#include "mapping/graph/map_graph.hpp"

namespace fiducap {

namespace {

/// The segments of the workspace as far as equations need them: without the raw data.
GraphState workspace_of(const GraphState& graph) {
  GraphState out;
  out.bodies = graph.bodies;
  out.nodes = graph.nodes;
  out.starts = graph.starts;
  out.level = graph.level;
  out.prints_scale = graph.prints_scale;
  out.prints = graph.prints;
  out.doubts = graph.doubts;
  out.gravity_offset_m_s2 = graph.gravity_offset_m_s2;
  out.gravity_sigma_m_s2 = graph.gravity_sigma_m_s2;
  for (const GraphSegment& segment : graph.segments) {
    if (graph.nodes[segment.begin].component != kInWorkspace) continue;
    GraphSegment& copy = out.segments.emplace_back();
    copy.raw.sensors = segment.raw.sensors;
    copy.factor = segment.factor;
    copy.begin = segment.begin;
    copy.end = segment.end;
    copy.tags = segment.tags;
  }
  (void)keep_segments([](const GraphSegment&) { return true; }, out);
  return out;
}

/// What the segments of the workspace, and the prior that there is, say of tags and cameras.
/// What is in no component with the workspace stays as segments; to be counted once, it may have no
/// say here.
std::optional<GraphPrior> prior_of(const GraphState& graph) {
  GraphState part = workspace_of(graph);
  // Tags of other components are bound by nothing then.
  std::vector<std::size_t> now(graph.tags.size(), 0);
  std::vector<std::size_t> was;
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    if (graph.tags[i].component != kInWorkspace) continue;
    now[i] = part.tags.size();
    was.push_back(i);
    part.tags.push_back(graph.tags[i]);
  }
  for (GraphSegment& segment : part.segments)
    for (std::size_t& tag : segment.tags) tag = now[tag];
  part.prior = graph.prior;
  part.prior.renumber(now);
  const auto covariance = GraphCovariance::of(part);
  if (!covariance) return std::nullopt;

  const Eigen::MatrixXd columns = covariance->camera_columns();
  PriorCameras cameras;
  cameras.covariance.resize(columns.cols(), columns.cols());
  Eigen::Index at = 0;
  for (std::size_t b = 0; b < part.bodies.size(); ++b) {
    cameras.bodies.push_back(part.bodies[b].cameras);
    const Eigen::MatrixXd rows = covariance->camera_rows(columns, b);
    cameras.covariance.middleRows(at, rows.rows()) = rows;
    at += rows.rows();
  }
  std::vector<PriorTag> tags;
  for (std::size_t i = 0; i < part.tags.size(); ++i) {
    tags.push_back({was[i], part.tags[i].X_WT, *covariance->between(i, i), false});
    cameras.of_tags.push_back(covariance->tag_rows(columns, i));
  }
  const auto bound = bound_tags(part);
  const auto between = [&](std::size_t a, std::size_t b) -> std::optional<Matrix6d> {
    if (!bound.contains({std::min(a, b), std::max(a, b)})) return std::nullopt;
    return covariance->between(a, b);
  };
  const PriorUnknown relative =
      part.level.at(kInWorkspace) ? PriorUnknown::kPlaceAndYaw : PriorUnknown::kPlaceAndTurn;
  return make_prior(tags, between, cameras,
                    part.prior.is_absolute ? PriorUnknown::kNothing : relative);
}

/// Of a component with this many tags. A place has a size, however long it is looked at; memory
/// (0.2 MB a segment) and the time of a solution are bounded by this.
std::size_t most_segments(std::size_t tags) {
  constexpr std::size_t kFew = 150;
  constexpr std::size_t kPerTag = 6;
  constexpr std::size_t kMost = 2000;
  return std::min(kFew + kPerTag * tags, kMost);
}

}  // namespace

/// What the segments of the workspace say becomes a prior. Of a component that is not placed yet,
/// and of a workspace that never comes to rest, the oldest half goes.
void MapGraph::keep_bounded(bool is_at_rest) {
  std::map<int, std::size_t> segments;
  std::map<int, std::size_t> tags;
  for (const GraphSegment& segment : state_.segments) ++segments[component_of(segment)];
  for (const GraphTag& tag : state_.tags) ++tags[tag.component];
  for (const auto& [component, count] : segments) {
    const std::size_t most = most_segments(tags[component]);
    const bool is_placed = component == kInWorkspace;
    if (is_placed && is_at_rest) {
      if (count > most) fold();
    } else if (count > (is_placed ? 2 * most : most)) {
      forget_oldest(component, count / 2);
    }
  }
}

void MapGraph::forget_oldest(int component, std::size_t count) {
  std::size_t left = count;
  renumber_chains(keep_segments(
      [&](const GraphSegment& segment) {
        if (left == 0 || component_of(segment) != component) return true;
        --left;
        return false;
      },
      state_));
  drop_unbound(component);
}

void MapGraph::fold() {
  auto prior = prior_of(state_);
  if (!prior) return;
  renumber_chains(keep_segments(
      [&](const GraphSegment& segment) { return component_of(segment) != kInWorkspace; }, state_));
  state_.prior = std::move(*prior);
  for (GraphTag& tag : state_.tags)
    if (tag.component == kInWorkspace) tag.sightings_before = tag.sightings;
  fold_doubts(state_);
}

/// After segments have lost tags, or a component segments.
void MapGraph::drop_unbound(int component) {
  forget_unseen_tags(state_);
  count_sightings();
  // The workspace is 0; new ones are counted from 1.
  components_ = split_component(component, components_ + 1, state_) - 1;
  renumber_chains(forget_unbound_paths(state_));
}

}  // namespace fiducap
