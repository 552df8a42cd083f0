#include "mapping/graph/graph_components.hpp"

#include <algorithm>

#include <Eigen/Geometry>

#include "detection/tag_pose.hpp"
#include "mapping/graph/graph_datum.hpp"

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
  for (GraphSegment& segment : graph.segments)
    for (std::size_t& i : segment.tags) i = now[i];
}

}  // namespace

void move_component(int component, const Pose& T, GraphState& graph) {
  for (GraphNode& node : graph.nodes)
    if (node.component == component) node.at = in_other_axes(T, node.at);
  for (GraphTag& tag : graph.tags)
    if (tag.component == component) tag.X_WT = T * tag.X_WT;
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

std::optional<Pose> axes_of_given(std::span<const KnownTag> given, const GraphState& graph) {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
  for (const KnownTag& tag : given) {
    for (const GraphTag& own : graph.tags) {
      if (own.component != 0 || own.tag_id != tag.tag_id) continue;
      for (int i = 0; i < 4; ++i)
        points.emplace_back(own.X_WT * tag_corner(i, tag.edge_m),
                            tag.X_WT * tag_corner(i, tag.edge_m));
    }
  }
  if (points.empty()) return std::nullopt;
  const auto level = graph.level.find(0);
  if (level != graph.level.end() && level->second) return lay_over(points);
  Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(points.size()));
  Eigen::Matrix3Xd to(3, from.cols());
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    from.col(i) = points[static_cast<std::size_t>(i)].first;
    to.col(i) = points[static_cast<std::size_t>(i)].second;
  }
  const Eigen::Matrix4d T = Eigen::umeyama(from, to, false);
  return Pose{Eigen::Quaterniond(T.topLeftCorner<3, 3>()).normalized(), T.topRightCorner<3, 1>()};
}

}  // namespace fiducap
