#include "estimation/world/corner_measurement.hpp"

#include "base/so3.hpp"

namespace fiducap::world {

const Pose& place_of(const FilterState& state, const TagToUse& tag) {
  return tag.local >= 0 ? state.tags[static_cast<std::size_t>(tag.local)].X_WT : tag.known->X_WT;
}

TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model, const TagToUse& tag,
                       double corner_noise_px) {
  TagMeasurement m;
  m.tag_id = tag.seen->tag_id;
  m.R = Matrix8d::Identity() * corner_noise_px * corner_noise_px;
  const Pose X_WV = state.X_WV(camera);
  const Pose& X_WT = place_of(state, tag);
  const CornerResidual residual = corner_residual(*tag.seen, X_WV.inverse() * X_WT, model);
  m.in_front = residual.in_front;
  m.y = residual.y;
  if (!m.in_front) return m;

  const Eigen::Matrix3d R_VW = X_WV.rotation().transpose();
  const Matrix83d H_rho = residual.H.leftCols<3>() * R_VW;
  const Matrix83d H_phi = residual.H.rightCols<3>() * R_VW - H_rho * skew(X_WT.p);
  m.add(layout::camera(camera), -H_rho);
  m.add(layout::camera(camera) + 3, -H_phi);
  if (tag.local >= 0) {
    m.add(state.tag_at(static_cast<std::size_t>(tag.local)), H_rho);
    m.add(state.tag_at(static_cast<std::size_t>(tag.local)) + 3, H_phi);
  }
  return m;
}

}  // namespace fiducap::world
