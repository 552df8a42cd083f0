#pragma once

#include <optional>
#include <vector>

#include "base/stamped_pose.hpp"
#include "mapping/graph/graph_covariance.hpp"
#include "mapping/graph/graph_state.hpp"

namespace fiducap {

/// The raw segment with its ends, cameras and tags where the graph has them now, and the path
/// between brought along.
[[nodiscard]] MotionSegment segment_now(const GraphState& graph, const GraphSegment& segment);

/// A body at one instant, by everything that anybody has seen, before and after.
struct PathPose {
  Instant at{};
  Pose X_WB;
  Matrix6d covariance{Matrix6d::Zero()};  ///< Place and rotation vector, both in W axes.
};

/// A body's poses at all instances of its segments of one component, in order of time.
/// @param covariance  of this graph, which has come to rest; nullptr: nobody asks for it
/// @return nullopt: a number is not finite
[[nodiscard]] std::optional<std::vector<PathPose>> path_of(int body_id, const GraphState& graph,
                                                           const GraphCovariance* covariance,
                                                           int component = kInWorkspace);

}  // namespace fiducap
