#pragma once

#include <optional>
#include <vector>

#include "detection/points/point_tracker.hpp"
#include "detection/tag_search.hpp"
#include "simulation/simulation.hpp"

namespace fiducap {

/// Tags and followed points of rendered images, found as the server finds them, but led by the
/// truth instead of a filter: so that several filters can be run over the same sightings.
class RenderedCorners final {
 public:
  RenderedCorners(const simulation::RoomConfig& room, const CameraMount& camera);

  [[nodiscard]] CornerFrame look(const CameraFrame& image,
                                 const simulation::SimulatedSource& source);
  [[nodiscard]] double follow_cpu_s() const { return follow_cpu_s_; }

 private:
  void expect(const Pose& X_WV);

  CameraMount camera_;
  std::vector<RecordedTag> tags_;
  TagSearch search_;
  PointTracker points_;
  std::vector<ExpectedTag> expected_;
  std::optional<Eigen::Quaterniond> q_before_;
  double follow_cpu_s_{0};
};

}  // namespace fiducap
