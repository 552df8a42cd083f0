#include "mapping/graph/graph_fold.hpp"

#include <algorithm>
#include <utility>

#include "mapping/graph/graph_components.hpp"
#include "mapping/graph/graph_covariance.hpp"

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

}  // namespace

/// What is in no component with the workspace stays as segments; to be counted once, it may have no
/// say here.
std::optional<GraphPrior> prior_of(const GraphState& graph) {
  GraphState part = workspace_of(graph);
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

}  // namespace fiducap
