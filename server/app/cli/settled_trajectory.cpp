#include "app/cli/settled_trajectory.hpp"

#include <algorithm>
#include <cmath>

#include "base/so3.hpp"
#include "detection/tag_pose.hpp"
#include "estimation/resection.hpp"

namespace fiducap {

namespace {

constexpr double kInlierSigmas = 5.0;
constexpr double kFirstInlierSigmas = 50.0;
constexpr double kCostCap = 8 * kInlierSigmas * kInlierSigmas;
// Where two answers explain an image equally well, the one that continues the last attitude is right.
constexpr double kTurnSigma_rad = 0.5;
constexpr Duration kLastCounts = std::chrono::seconds(2);

double size_px(const TagObservation& tag) { return (tag.corners_px[0] - tag.corners_px[2]).norm(); }

double misfit(const Pose& X_WB, const CameraMount& camera, const std::vector<PlacedTag>& tags, double noise_px) {
  const Pose X_VW = (X_WB * camera.X_BV).inverse();
  double cost = 0;
  for (const PlacedTag& tag : tags) {
    const CornerResidual r = corner_residual(*tag.seen, X_VW * tag.X_AT, camera.model);
    cost += r.in_front ? std::min(kCostCap, r.y.squaredNorm() / (noise_px * noise_px)) : kCostCap;
  }
  return cost;
}

}  // namespace

void SettledTrajectory::add(const TagObservations& seen, const std::optional<Pose>& X_WB, const std::vector<KnownTag>& tags) {
  if (seen.tags.empty()) return;
  Image image{seen, X_WB, {}};
  for (const KnownTag& tag : tags) {
    const bool visible = std::any_of(seen.tags.begin(), seen.tags.end(), [&](const auto& s) { return s.tag_id == tag.tag_id; });
    if (visible) image.X_WT[tag.tag_id] = tag.X_WT;
  }
  images_.push_back(std::move(image));
}

std::optional<Pose> SettledTrajectory::place(const Image& image, const CameraMount& camera, const std::map<int, Pose>& map,
                                             const std::optional<StampedPose>& last) const {
  std::vector<PlacedTag> placed;
  for (const TagObservation& tag : image.seen.tags) {
    if (const auto found = map.find(tag.tag_id); found != map.end()) placed.push_back({&tag, found->second});
  }
  if (placed.empty()) return std::nullopt;
  std::sort(placed.begin(), placed.end(), [](const auto& a, const auto& b) { return size_px(*a.seen) > size_px(*b.seen); });
  const auto refine = [&](const Pose& start) {
    const Pose near = resect(start, camera.X_BV, camera.model, placed, kFirstInlierSigmas * corner_noise_px_);
    return resect(near, camera.X_BV, camera.model, placed, kInlierSigmas * corner_noise_px_);
  };
  for (const PlacedTag& tag : placed) {
    const auto then = image.X_WT.find(tag.seen->tag_id);
    if (image.X_WB && then != image.X_WT.end()) return refine(tag.X_AT * then->second.inverse() * *image.X_WB);
  }
  std::optional<Pose> best;
  double best_cost = 0;
  for (const PlacedTag& tag : placed) {
    for (const TagPose& pose : solve_tag_pose(*tag.seen, camera.model)) {
      if (!std::isfinite(pose.rms_px)) continue;
      const Pose X_WB = refine(tag.X_AT * (camera.X_BV * pose.X_VT).inverse());
      double cost = misfit(X_WB, camera, placed, corner_noise_px_);
      if (last && image.seen.exposed_at - last->at < kLastCounts) {
        cost += std::pow(angle_between(X_WB.q, last->X_WB.q) / kTurnSigma_rad, 2);
      }
      if (best && cost >= best_cost) continue;
      best = X_WB;
      best_cost = cost;
    }
  }
  return best;
}

std::vector<StampedPose> SettledTrajectory::settle(const std::vector<CameraMount>& cameras,
                                                   const std::vector<KnownTag>& map) const {
  std::map<int, Pose> places;
  for (const KnownTag& tag : map) places[tag.tag_id] = tag.X_WT;
  std::vector<StampedPose> poses;
  for (const Image& image : images_) {
    const CameraMount& camera = cameras.at(static_cast<std::size_t>(image.seen.camera));
    const std::optional<StampedPose> last = poses.empty() ? std::nullopt : std::optional(poses.back());
    const auto X_WB = place(image, camera, places, last);
    if (!X_WB) continue;
    if (last && last->at == image.seen.exposed_at) poses.pop_back();  // another camera of the same instant
    poses.push_back({image.seen.exposed_at, *X_WB});
  }
  return poses;
}

}  // namespace fiducap
