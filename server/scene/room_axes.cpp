#include "scene/room_axes.hpp"

#include <cmath>
#include <utility>

#include "base/so3.hpp"

namespace fiducap {

namespace {

bool are_same(const Pose& a, const Pose& b) { return a.p == b.p && a.q.coeffs() == b.q.coeffs(); }

Pose levelled(const Pose& X) {
  const Eigen::Vector3d x = X.q * Eigen::Vector3d::UnitX();
  return {exp_so3({0, 0, std::atan2(x.y(), x.x())}), X.p};
}

/// The same map in the room's axes. What errors share (TagMap::known) is left out: that is for
/// filters, which live in W.
TagMap in_room(const TagMap& map) {
  TagMap out = map;
  const Pose X_RW = levelled(map.X_RW);
  out.X_RW = {};
  out.known.reset();
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = X_RW.rotation();
  for (MapTag& entry : out.tags) {
    entry.tag.X_WT = X_RW * entry.tag.X_WT;
    entry.tag.covariance = turn * entry.tag.covariance * turn.transpose();
  }
  return out;
}

}  // namespace

std::shared_ptr<const TagMap> RoomAxes::of(std::shared_ptr<const TagMap> map) {
  if (map == map_) return moved_;
  is_workspace_ = map == nullptr || are_same(map->X_RW, {});
  const Pose X_RW = is_workspace_ ? Pose{} : levelled(map->X_RW);
  if (!are_same(X_RW, X_RW_)) ++number_;
  X_RW_ = X_RW;
  R_RW_ = X_RW_.rotation();
  moved_ = is_workspace_ ? map : std::make_shared<const TagMap>(in_room(*map));
  map_ = std::move(map);
  return moved_;
}

void RoomAxes::bring(BodyPose& pose) const {
  if (is_workspace_) return;
  pose.X_WP = X_RW_ * pose.X_WP;
  pose.v_WP = R_RW_ * pose.v_WP;
  pose.a_WP = R_RW_ * pose.a_WP;
  // Position, attitude and velocity are in W, the body's rate in P.
  constexpr int kTurned = 3;
  for (int block = 0; block < kTurned; ++block) {
    auto rows = pose.covariance.middleRows<3>(3 * block);
    rows = (R_RW_ * rows).eval();
  }
  for (int block = 0; block < kTurned; ++block) {
    auto columns = pose.covariance.middleCols<3>(3 * block);
    columns = (columns * R_RW_.transpose()).eval();
  }
}

}  // namespace fiducap
