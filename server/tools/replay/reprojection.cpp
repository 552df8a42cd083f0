#include "tools/replay/reprojection.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "detection/tag_pose.hpp"

namespace fiducap {

namespace {

/// @return nullopt when it is one of those without a value
std::optional<double> quantile_of_all(std::vector<double> values, std::size_t count, double share) {
  const double place = share * static_cast<double>(count) - share;
  if (!(place <= static_cast<double>(values.size()) - 1)) return std::nullopt;
  values.resize(count, *std::max_element(values.begin(), values.end()));
  return quantile(std::move(values), share);
}

/// Half the time between two images of one camera; the cameras take turns.
Duration half_median_step(std::span<const StampedPose> poses, std::size_t cameras) {
  std::vector<Duration> steps;
  for (std::size_t i = cameras; i < poses.size(); ++i)
    steps.push_back(poses[i].at - poses[i - cameras].at);
  if (steps.empty()) return Duration{0};
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle / 2;
}

}  // namespace

ReprojectionMeter::ReprojectionMeter(std::vector<CameraMount> cameras,
                                     std::span<const StampedPose> poses,
                                     std::span<const TagPlace> map)
    : cameras_(std::move(cameras)), half_period_(half_median_step(poses, cameras_.size())) {
  add_part(poses, map);
}

void ReprojectionMeter::add_part(std::span<const StampedPose> poses,
                                 std::span<const TagPlace> map) {
  parts_.push_back({poses, {}});
  for (const TagPlace& tag : map) parts_.back().map.emplace(tag.tag_id, tag);
}

void ReprojectionMeter::add(const CornerFrame& frame) {
  ++counts_.frames;
  if (frame.tags.empty()) return;
  ++counts_.frames_with_tags;
  counts_.detections += static_cast<int>(frame.tags.size());
  for (const Part& part : parts_) {
    const StampedPose* pose = pose_near(part.poses, frame.exposed_at);
    if (pose == nullptr) continue;
    ++(&part == &parts_.front() ? counts_.frames_with_tags_and_pose
                                : counts_.frames_with_tags_in_parts);
    const CameraMount& camera = cameras_.at(static_cast<std::size_t>(frame.camera));
    const Pose X_VW = (pose->X_WB * camera.X_BV).inverse();
    for (const TagSighting& seen : frame.tags) score(seen, camera, X_VW, part.map);
    return;
  }
  counts_.without_pose += static_cast<int>(frame.tags.size());
}

const StampedPose* ReprojectionMeter::pose_near(std::span<const StampedPose> poses,
                                                Instant at) const {
  const auto after = std::lower_bound(poses.begin(), poses.end(), at,
                                      [](const StampedPose& p, Instant t) { return p.at < t; });
  auto nearest = after;
  if (after == poses.end() || (after != poses.begin() && at - (after - 1)->at < after->at - at)) {
    if (after == poses.begin()) return nullptr;
    nearest = after - 1;
  }
  const Duration apart = nearest->at < at ? at - nearest->at : nearest->at - at;
  return apart <= half_period_ ? &*nearest : nullptr;
}

void ReprojectionMeter::score(const TagSighting& seen, const CameraMount& camera, const Pose& X_VW,
                              const std::map<int, TagPlace>& map) {
  const auto tag = map.find(seen.tag_id);
  if (tag == map.end()) {
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
  summary.p95_of_all_px =
      quantile_of_all(errors_px_, static_cast<std::size_t>(summary.detections), 0.95);
  return summary;
}

}  // namespace fiducap
