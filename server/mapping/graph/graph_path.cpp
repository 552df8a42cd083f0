#include "mapping/graph/graph_path.hpp"

#include <algorithm>
#include <utility>

#include "estimation/filter/heading_rule.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap {

namespace {

/// From errors about W's origin to those about where a segment begins.
Eigen::MatrixXd about(const Eigen::Vector3d& origin, const GraphSegment& segment,
                      const Eigen::MatrixXd& covariance) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const Matrix6d Ad = world::adjoint(Pose{Eigen::Quaterniond::Identity(), -origin});
  Eigen::MatrixXd out = covariance;
  const auto turn = [&](int at) {
    out.middleRows<6>(at) = (Ad * out.middleRows<6>(at)).eval();
    out.middleCols<6>(at) = (out.middleCols<6>(at) * Ad.transpose()).eval();
  };
  turn(kBegin);
  turn(kEnd);
  const int cameras = static_cast<int>(segment.factor.cameras.size());
  for (std::size_t i = 0; i < segment.tags.size(); ++i) turn(tag(cameras, static_cast<int>(i)));
  return out;
}

PathPose pose_at(const BodyMoment& body, const Eigen::Vector3d& origin, const Matrix6d& error) {
  const Matrix6d J = world::plain_from_world_error(body.X_WB.p - origin);
  return {body.at, body.X_WB, J * error * J.transpose()};
}

/// All instances but the first, which is another segment's last, unless a chain begins here.
bool add_path(const GraphState& graph, const GraphSegment& segment, bool begins_chain,
              const Eigen::MatrixXd* of_rest, std::vector<PathPose>& out) {
  MotionSegment now = segment_now(graph, segment);
  const std::vector<PathPoint> between = path_between(now);
  if (between.size() + 2 != now.instances.size()) return false;
  const Eigen::Vector3d& origin = now.begin().X_WB.p;
  if (of_rest == nullptr) {
    for (std::size_t k = begins_chain ? 0 : 1; k < now.instances.size(); ++k)
      out.push_back({now.instances[k].body.at, now.instances[k].body.X_WB});
    return true;
  }
  const Eigen::MatrixXd rest = about(origin, segment, *of_rest);
  const auto own = [&](int at) { return Matrix6d(rest.block<6, 6>(at, at)); };
  if (begins_chain) out.push_back(pose_at(now.begin(), origin, own(segment_layout::kBegin)));
  for (std::size_t k = 0; k < between.size(); ++k) {
    const auto by_rest = between[k].by_rest.topRows<6>();
    const Matrix6d error =
        between[k].given.topLeftCorner<6, 6>() + by_rest * rest * by_rest.transpose();
    out.push_back(pose_at(now.instances[k + 1].body, origin, error));
  }
  out.push_back(pose_at(now.end(), origin, own(segment_layout::kEnd)));
  return true;
}

}  // namespace

MotionSegment segment_now(const GraphState& graph, const GraphSegment& segment) {
  MotionSegment now = segment.raw;
  // The path between goes along with where it begins.
  const BodyMoment& begin = graph.nodes[segment.begin].at;
  const Pose G = axes_between(now.begin().X_WB, begin.X_WB, now.has_imu());
  for (MotionSegment::Instance& instance : now.instances)
    instance.body = in_other_axes(G, instance.body);
  now.instances.front().body = begin;
  now.instances.back().body = graph.nodes[segment.end].at;
  now.cameras = graph.bodies[static_cast<std::size_t>(graph.nodes[segment.begin].body)].cameras;
  now.scales.resize(segment.tags.size());
  for (std::size_t i = 0; i < segment.tags.size(); ++i) {
    const GraphTag& tag = graph.tags[segment.tags[i]];
    now.tags[i].X_WT = tag.X_WT;
    now.scales[i] = graph.prints_scale + tag.scale;
  }
  now.gravity_offset_m_s2 = graph.gravity_offset_m_s2;
  return now;
}

std::optional<std::vector<PathPose>> path_of(int body_id, const GraphState& graph,
                                             const GraphCovariance* covariance, int component) {
  std::vector<PathPose> path;
  std::optional<std::size_t> last;
  for (const GraphSegment& segment : graph.segments) {
    if (segment.raw.body_id != body_id) continue;
    if (graph.nodes[segment.begin].component != component) continue;
    const auto of_rest = covariance != nullptr ? covariance->of(segment) : std::nullopt;
    if (covariance != nullptr && !of_rest) return std::nullopt;
    if (!add_path(graph, segment, last != segment.begin, of_rest ? &*of_rest : nullptr, path))
      return std::nullopt;
    last = segment.end;
  }
  std::stable_sort(path.begin(), path.end(),
                   [](const PathPose& a, const PathPose& b) { return a.at < b.at; });
  const bool is_finite = std::all_of(path.begin(), path.end(), [](const PathPose& pose) {
    return pose.X_WB.p.allFinite() && pose.covariance.allFinite();
  });
  return is_finite ? std::optional(std::move(path)) : std::nullopt;
}

}  // namespace fiducap
