#include "estimation/world/corner_measurement.hpp"

#include "base/so3.hpp"

namespace fiducap::world {

using namespace layout;  // NOLINT: the block names are the subject of this file

const Pose& place_of(const FilterState& state, const TagToUse& tag) {
  return tag.local >= 0 ? state.tags[static_cast<std::size_t>(tag.local)].X_WT : tag.known->X_WT;
}

TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model, const TagToUse& tag,
                       double corner_noise_px) {
  TagMeasurement m;
  m.tag_id = tag.seen->tag_id;
  m.R = Matrix8d::Identity() * corner_noise_px * corner_noise_px;
  const Pose& X_BV = state.X_BV[static_cast<std::size_t>(camera)];
  const Pose& X_WT = place_of(state, tag);
  const Pose X_BT = state.X_WB.inverse() * X_WT;
  const CornerResidual residual = corner_residual(*tag.seen, X_BV.inverse() * X_BT, model);
  m.in_front = residual.in_front;
  m.y = residual.y;
  if (!m.in_front) return m;

  const Eigen::Matrix3d R_VB = X_BV.rotation().transpose();
  const Matrix83d H_Bp = residual.H.leftCols<3>() * R_VB;   // towards the tag's position in B axes
  const Matrix83d H_Bq = residual.H.rightCols<3>() * R_VB;  // towards its turning, B axes
  m.add(extrinsics(camera), -H_Bp);
  m.add(extrinsics(camera) + 3, H_Bp * skew(X_BT.p - X_BV.p) - H_Bq);

  const Eigen::Matrix3d R_BW = state.X_WB.rotation().transpose();
  const Matrix83d H_rho = H_Bp * R_BW;
  const Matrix83d H_phi = H_Bq * R_BW - H_rho * skew(X_WT.p);
  m.add(kPosition, -H_rho);
  m.add(kAttitude, -H_phi);
  if (tag.local >= 0) {
    m.add(state.tag_at(static_cast<std::size_t>(tag.local)), H_rho);
    m.add(state.tag_at(static_cast<std::size_t>(tag.local)) + 3, H_phi);
  }
  return m;
}

}  // namespace fiducap::world
