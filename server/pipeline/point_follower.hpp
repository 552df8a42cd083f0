#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "detection/points/point_tracker.hpp"

namespace fiducap {

/// Follows image points in every camera of one body, led by how the body's own estimate says that
/// the camera has turned.
class PointFollower final {
 public:
  explicit PointFollower(std::size_t cameras) : eyes_(cameras) {}

  /// @param q_WV  the camera's attitude at this image, as predicted; nullopt: not known
  /// @return see PointTracker
  std::span<const PointSighting> follow(const CameraFrame& frame, const CameraModel& model,
                                        const std::optional<Eigen::Quaterniond>& q_WV,
                                        std::span<const TagSighting> tags);
  /// What the filter made of a camera's last image: its attitude there, in the axes that the next
  /// prediction will be in; nullopt: not known.
  void corrected(int camera, const std::optional<Eigen::Quaterniond>& q_WV);

  [[nodiscard]] PointStatistics statistics() const;

 private:
  struct Eye {
    PointTracker tracker;
    std::optional<Eigen::Quaterniond> q_WV;
  };
  std::vector<Eye> eyes_;
};

}  // namespace fiducap
