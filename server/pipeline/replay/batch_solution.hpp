#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "capture/odometry.hpp"
#include "mapping/graph/graph_path.hpp"
#include "pipeline/replay/bodies_replay.hpp"
#include "pipeline/replay/image_log.hpp"

namespace fiducap {

/// One body of a replay that is over.
struct BatchBody {
  int id{};
  const PipelineSetup* setup{};
  const ImageLog* log{};       ///< Of a body without IMU; else not looked at, like its …
  const Odometry* odometry{};  ///< … or nullptr: nobody knows how it moved.
};

struct BatchResult {
  BodiesReplay::LastRefinement last;
  int rounds{};  ///< Of placement, where a body has no IMU.
  /// All bodies have odometry that covers what they saw, and no filter was asked for anything.
  bool is_by_odometry{};
  /// What odometry is doubted for, in words, by the id of its body.
  std::map<int, std::string> doubts;
};

/// Solves for everything that was seen, after the last image. What a body with an IMU has seen is
/// in the graph as its filter followed it. Without one every image is placed again in what is known
/// by now (ImagePlacement) and by its odometry, and that goes into the graph in its place; again,
/// while a better map takes images or tags to other places.
[[nodiscard]] BatchResult solve_all(BodiesReplay& replay, std::span<const BatchBody> bodies,
                                    const std::function<void(int round)>& progress);

}  // namespace fiducap
