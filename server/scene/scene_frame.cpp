#include "scene/scene_frame.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/pose.hpp"

namespace fiducap {

namespace {

constexpr std::uint64_t kRecent = 50;  // sightings: two seconds of one camera

bool are_same(const Pose& a, const Pose& b) { return a.p == b.p && a.q.coeffs() == b.q.coeffs(); }

Pose levelled(const Pose& X) {
  const Eigen::Vector3d x = X.q * Eigen::Vector3d::UnitX();
  return {exp_so3({0, 0, std::atan2(x.y(), x.x())}), X.p};
}

/// The map in the room's axes, without the joint errors (TagMap::known) that only filters use.
TagMap map_in_room(const TagMap& map) {
  TagMap out = map;
  const Pose X_RW = levelled(map.X_RW);
  out.X_RW = {};
  out.known.reset();
  Matrix6d rotation = Matrix6d::Zero();
  rotation.topLeftCorner<3, 3>() = rotation.bottomRightCorner<3, 3>() = X_RW.rotation();
  for (MapTag& entry : out.tags) {
    entry.tag.X_WT = X_RW * entry.tag.X_WT;
    entry.tag.covariance = rotation * entry.tag.covariance * rotation.transpose();
  }
  return out;
}

}  // namespace

std::shared_ptr<const TagMap> RoomAxes::set_map(std::shared_ptr<const TagMap> map) {
  if (map == map_) return map_in_room_;
  is_workspace_ = map == nullptr || are_same(map->X_RW, {});
  const Pose X_RW = is_workspace_ ? Pose{} : levelled(map->X_RW);
  if (!are_same(X_RW, X_RW_)) ++number_;
  X_RW_ = X_RW;
  R_RW_ = X_RW_.rotation();
  map_in_room_ = is_workspace_ ? map : std::make_shared<const TagMap>(map_in_room(*map));
  map_ = std::move(map);
  return map_in_room_;
}

void RoomAxes::transform(BodyPose& pose) const {
  if (is_workspace_) return;
  pose.X_WP = X_RW_ * pose.X_WP;
  pose.v_WP = R_RW_ * pose.v_WP;
  pose.a_WP = R_RW_ * pose.a_WP;
  // Position, attitude and velocity are in W; the body's rate is in P.
  constexpr int kBlocksInW = 3;
  for (int block = 0; block < kBlocksInW; ++block) {
    auto rows = pose.covariance.middleRows<3>(3 * block);
    rows = (R_RW_ * rows).eval();
  }
  for (int block = 0; block < kBlocksInW; ++block) {
    auto columns = pose.covariance.middleCols<3>(3 * block);
    columns = (columns * R_RW_.transpose()).eval();
  }
}

void TagFits::add(const UpdateReport& report) {
  if (report.tags_measured == 0 || report.start_is_open) return;
  const std::lock_guard lock(mutex_);
  for (const auto& fit : report.named_fits()) add(fit, report.exposed_at);
}

void TagFits::add(const UpdateReport::CornerFit& fit, Instant seen_at) {
  if (!std::isfinite(fit.rms_px)) return;
  auto at = std::lower_bound(fits_.begin(), fits_.end(), fit.tag_id,
                             [](const TagFit& one, int id) { return one.tag_id < id; });
  if (at == fits_.end() || at->tag_id != fit.tag_id) {
    if (fits_.size() == kMostTags) return;
    at = fits_.insert(at, TagFit{.tag_id = fit.tag_id});
  }
  const auto weight = static_cast<double>(std::min(++at->sightings, kRecent));
  const double square = at->rms_px * at->rms_px;
  at->rms_px = std::sqrt(square + (fit.rms_px * fit.rms_px - square) / weight);
  at->seen_at = std::max(at->seen_at, seen_at);
}

}  // namespace fiducap
