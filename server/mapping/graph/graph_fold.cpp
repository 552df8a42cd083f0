#include "mapping/graph/graph_fold.hpp"

#include <algorithm>
#include <utility>

#include "mapping/graph/graph_covariance.hpp"

namespace fiducap {

namespace {

/// The nodes, segments and starts of the workspace, or all others. Tags stay as they are.
FoldedGraph part_of(const GraphState& graph, bool of_workspace) {
  FoldedGraph out;
  out.state.bodies = graph.bodies;
  out.state.tags = graph.tags;
  out.state.level = graph.level;
  out.state.prints_scale = graph.prints_scale;
  out.state.prints = graph.prints;
  out.state.doubts = graph.doubts;
  out.state.gravity_offset_m_s2 = graph.gravity_offset_m_s2;
  out.state.gravity_sigma_m_s2 = graph.gravity_sigma_m_s2;
  out.nodes.resize(graph.nodes.size());
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    if ((graph.nodes[i].component == kInWorkspace) != of_workspace) continue;
    out.nodes[i] = out.state.nodes.size();
    out.state.nodes.push_back(graph.nodes[i]);
  }
  for (const GraphSegment& segment : graph.segments) {
    if (!out.nodes[segment.begin]) continue;
    out.state.segments.push_back(segment);
    out.state.segments.back().begin = *out.nodes[segment.begin];
    out.state.segments.back().end = *out.nodes[segment.end];
  }
  for (ChainStart start : graph.starts) {
    if (!out.nodes[start.node]) continue;
    start.node = *out.nodes[start.node];
    const auto after =
        start.after < 0 ? std::nullopt : out.nodes[static_cast<std::size_t>(start.after)];
    start.after = after ? static_cast<int>(*after) : -1;
    out.state.starts.push_back(start);
  }
  return out;
}

}  // namespace

/// What is in no component with the workspace stays as segments; to be counted once, it may have no
/// say here.
std::optional<GraphPrior> prior_of(const GraphState& graph) {
  GraphState part = part_of(graph, true).state;
  // Tags of other components are bound by nothing then.
  std::vector<std::size_t> now(graph.tags.size(), 0);
  std::vector<std::size_t> was;
  part.tags.clear();
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

FoldedGraph without_workspace_segments(GraphState graph, GraphPrior prior) {
  FoldedGraph out = part_of(graph, false);
  out.state.prior = std::move(prior);
  for (GraphTag& tag : out.state.tags)
    if (tag.component == kInWorkspace) tag.sightings_before = tag.sightings;
  return out;
}

}  // namespace fiducap
