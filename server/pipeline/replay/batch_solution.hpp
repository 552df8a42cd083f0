#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "capture/recording/odometry.hpp"
#include "mapping/graph/graph_covariance.hpp"
#include "pipeline/replay/bodies_replay.hpp"

namespace fiducap {

/// The images with tags of one body at one instant.
struct LoggedInstant {
  Instant at{};
  std::vector<TagObservations> images;
};
using ImageLog = std::vector<LoggedInstant>;
/// Appends an image with tags.
inline void add_to(ImageLog& log, const TagObservations& seen) {
  if (seen.tags.empty()) return;
  if (log.empty() || log.back().at != seen.exposed_at) log.push_back({seen.exposed_at, {}});
  log.back().images.push_back(seen);
}

/// One body of a replay that is over.
struct BatchBody {
  int id{};
  const PipelineSetup* setup{};
  const ImageLog* log{};       ///< Of a body without IMU; else unused, like …
  const Odometry* odometry{};  ///< … its odometry; nullptr: none.
};

struct BatchResult {
  BodiesReplay::LastRefinement last;
  int rounds{};  ///< Of placement, where a body has no IMU.
  bool
      is_by_odometry{};  ///< All bodies have odometry that covers their images; filters are unused.
  std::map<int, std::string> doubts;  ///< Messages about odometry, by body id.
};

/// Batch solution after the last image. Images of a body with an IMU are in the graph as its filter
/// followed them. Without IMU every image is placed again by the present map (ImagePlacement) and
/// odometry, and replaces the filter's segments in the graph; this is repeated while a better map
/// moves images or tags to other minima.
[[nodiscard]] BatchResult solve_all(BodiesReplay& replay, std::span<const BatchBody> bodies,
                                    const std::function<void(int round)>& progress);

}  // namespace fiducap
