#include "app/cli/reprojection.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "detection/tag_pose.hpp"

namespace fiducap {

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  const double part = place - static_cast<double>(below);
  return (1 - part) * values[below] + part * values[above];
}

ReprojectionMeter::ReprojectionMeter(std::vector<CameraMount> cameras,
                                     std::span<const StampedPose> poses,
                                     std::span<const TagPlace> map)
    : cameras_(std::move(cameras)), poses_(poses) {
  for (const TagPlace& tag : map) map_.emplace(tag.tag_id, tag);
}

void ReprojectionMeter::add(const CornerFrame& frame) {
  ++counts_.frames;
  if (frame.tags.empty()) return;
  ++counts_.frames_with_tags;
  counts_.detections += static_cast<int>(frame.tags.size());
  const auto pose = std::lower_bound(poses_.begin(), poses_.end(), frame.exposed_at,
                                     [](const StampedPose& p, Instant at) { return p.at < at; });
  if (pose == poses_.end() || pose->at != frame.exposed_at) {
    counts_.without_pose += static_cast<int>(frame.tags.size());
    return;
  }
  ++counts_.frames_with_tags_and_pose;
  const CameraMount& camera = cameras_.at(static_cast<std::size_t>(frame.camera));
  const Pose X_VW = (pose->X_WB * camera.X_BV).inverse();
  for (const TagSighting& seen : frame.tags) score(seen, camera, X_VW);
}

void ReprojectionMeter::score(const TagSighting& seen, const CameraMount& camera,
                              const Pose& X_VW) {
  const auto tag = map_.find(seen.tag_id);
  if (tag == map_.end()) {
    ++counts_.without_tag;
    return;
  }
  double squares = 0;
  for (int i = 0; i < 4; ++i) {
    const auto px =
        camera.model.project(X_VW * (tag->second.X_WT * tag_corner(i, tag->second.edge_m)));
    if (!px) {
      ++counts_.outside_camera;
      return;
    }
    squares += (*px - seen.corners_px[static_cast<std::size_t>(i)]).squaredNorm();
  }
  errors_px_.push_back(std::sqrt(squares / 4));
}

ReprojectionSummary ReprojectionMeter::summary() const {
  ReprojectionSummary summary = counts_;
  summary.scored = static_cast<int>(errors_px_.size());
  summary.median_px = quantile(errors_px_, 0.5);
  summary.p95_px = quantile(errors_px_, 0.95);
  return summary;
}

}  // namespace fiducap
