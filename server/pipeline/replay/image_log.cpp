#include "pipeline/replay/image_log.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "detection/tag_geometry.hpp"

namespace fiducap {

double size_px(const TagObservation& tag) { return (tag.corners_px[0] - tag.corners_px[2]).norm(); }

void ImageLog::add(const BodyUpdate& update) {
  std::vector<KnownTag> tags = update.known;
  for (const TagBelief& belief : update.beliefs) tags.push_back(belief.tag);
  add(update.seen, update.is_placed() ? std::optional(update.estimate->X_WB) : std::nullopt, tags);
}

void ImageLog::add(const TagObservations& seen, const std::optional<Pose>& X_WB,
                   std::span<const KnownTag> tags) {
  if (seen.tags.empty()) return;
  if (instants_.empty() || instants_.back().at != seen.exposed_at)
    instants_.push_back({seen.exposed_at, {}, {}});
  LoggedInstant& instant = instants_.back();
  instant.images.push_back(seen);
  if (!X_WB) return;
  const TagObservation* nearest = nullptr;
  const KnownTag* then = nullptr;
  for (const TagObservation& tag : seen.tags) {
    const auto found =
        std::ranges::find_if(tags, [&](const auto& t) { return t.tag_id == tag.tag_id; });
    if (found == tags.end() || (nearest != nullptr && size_px(tag) <= size_px(*nearest))) continue;
    nearest = &tag;
    then = &*found;
  }
  if (then != nullptr) instant.proposals.push_back({then->tag_id, then->X_WT.inverse() * *X_WB});
}

namespace {

constexpr double kInlierSigmas = 5.0;
constexpr double kFirstInlierSigmas = 50.0;
// Residual of a tag behind the camera: a whole image.
constexpr double kBehind_px = 1000.0;

double misfit(const SightedTag& tag, const Pose& X_AB, double noise_px) {
  const CornerResidual r =
      corner_residual(*tag.seen, (X_AB * tag.X_BV).inverse() * tag.X_AT, *tag.camera);
  const Vector8d y = r.in_front ? r.y : Vector8d::Constant(kBehind_px);
  return kSightingBend * std::log1p(y.squaredNorm() / (noise_px * noise_px * kSightingBend));
}

// A hand-carried body turns and moves this far at once; beyond kWander its variance grows with
// time.
constexpr double kTurnSigma_rad = 0.5;
constexpr double kMoveSigma_m = 1.0;
constexpr Duration kWander = std::chrono::seconds(2);
// Errors of a pose by a single image.
constexpr double kImageTurn_rad = 0.1;
constexpr double kImageMove_m = 0.1;

}  // namespace

double misfit(std::span<const SightedTag> tags, const Pose& X_AB, double noise_px) {
  double cost = 0;
  for (const SightedTag& tag : tags) cost += misfit(tag, X_AB, noise_px);
  return cost;
}

Pose improved(const Pose& X_AB, std::span<const SightedTag> tags, double noise_px) {
  const Pose near = resect(X_AB, tags, kFirstInlierSigmas * noise_px);
  return resect(near, tags, kInlierSigmas * noise_px);
}

double motion_misfit(const StampedPose& a, const StampedPose& b, const Odometry* odometry) {
  const double seconds = to_seconds(std::chrono::abs(a.at - b.at));
  if (odometry != nullptr) {
    if (const auto moved = odometry->motion(a.at, b.at)) {
      const Pose expected = a.X_WB * *moved;
      const double turn_2 = kImageTurn_rad * kImageTurn_rad +
                            odometry->turn_noise_rad * odometry->turn_noise_rad * seconds;
      const double move_2 =
          kImageMove_m * kImageMove_m + odometry->move_noise_m * odometry->move_noise_m * seconds;
      const double turns = angle_between(expected.q, b.X_WB.q);
      return turns * turns / turn_2 + (expected.p - b.X_WB.p).squaredNorm() / move_2;
    }
  }
  const double turns = angle_between(a.X_WB.q, b.X_WB.q) / kTurnSigma_rad;
  const double moves = (a.X_WB.p - b.X_WB.p).norm() / kMoveSigma_m;
  return (turns * turns + moves * moves) / std::max(1.0, seconds / to_seconds(kWander));
}

}  // namespace fiducap
