#include "estimation/robocentric/corner_measurement.hpp"

#include "base/so3.hpp"

namespace fiducap::robocentric {

using namespace layout;  // NOLINT: the block names are the subject of this file

namespace {

/// Tag in B axes by the state, and its derivative towards what it depends on.
Pose tag_in_body(const FilterState& state, const TagToUse& tag) {
  if (tag.local >= 0) return state.X_BV[0] * state.tags[static_cast<std::size_t>(tag.local)].X_VT;
  return state.X_WB().inverse() * tag.known->X_WT;
}

/// Corner noise plus the uncertainty of the given place, which no state block carries.
Eigen::Matrix<double, 8, 8> noise_of(const FilterState& state, const TagToUse& tag,
                                     const Matrix86d& H_BT, double noise_px) {
  Eigen::Matrix<double, 8, 8> R = Eigen::Matrix<double, 8, 8>::Identity() * noise_px * noise_px;
  if (tag.local < 0) {
    Matrix6d B_from_W = Matrix6d::Zero();
    B_from_W.topLeftCorner<3, 3>() = state.q_WB.conjugate().toRotationMatrix();
    B_from_W.bottomRightCorner<3, 3>() = B_from_W.topLeftCorner<3, 3>();
    const Matrix86d H = H_BT * B_from_W;
    R.noalias() += H * tag.known->covariance * H.transpose();
  }
  return R;
}

void add_body_blocks(TagMeasurement& m, const FilterState& state, const Matrix86d& H_BT,
                     const Pose& X_BT) {
  const Matrix83d H_p = H_BT.leftCols<3>();
  const Matrix83d H_q = H_BT.rightCols<3>();
  m.add(kPosition, -H_p);
  m.add(kAttitude, H_p * skew(X_BT.p + state.p_WB_B) - H_q);
}

void add_tag_blocks(TagMeasurement& m, const FilterState& state, int local, const Matrix86d& H_BT) {
  const Pose& X_BV = state.X_BV[0];
  const Eigen::Matrix3d R_BV = X_BV.rotation();
  const Eigen::Vector3d arm_B = X_BV.q * state.tags[static_cast<std::size_t>(local)].X_VT.p;
  const Matrix83d H_p = H_BT.leftCols<3>();
  const Matrix83d H_q = H_BT.rightCols<3>();
  m.add(state.tag_at(static_cast<std::size_t>(local)), H_p * R_BV);
  m.add(state.tag_at(static_cast<std::size_t>(local)) + 3, H_q * R_BV);
  m.add(extrinsics(0), H_p);
  m.add(extrinsics(0) + 3, H_q - H_p * skew(arm_B));
}

}  // namespace

Pose predicted_tag(const FilterState& state, int camera, const TagToUse& tag) {
  if (tag.local >= 0 && camera == 0) return state.tags[static_cast<std::size_t>(tag.local)].X_VT;
  return state.X_BV[static_cast<std::size_t>(camera)].inverse() * tag_in_body(state, tag);
}

TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model,
                       const TagToUse& tag, double corner_noise_px) {
  TagMeasurement m;
  m.tag_id = tag.seen->tag_id;
  const CornerResidual residual =
      corner_residual(*tag.seen, predicted_tag(state, camera, tag), model);
  m.in_front = residual.in_front;
  m.y = residual.y;
  m.R = Eigen::Matrix<double, 8, 8>::Identity() * corner_noise_px * corner_noise_px;
  if (!m.in_front) return m;
  if (tag.local >= 0 && camera == 0) {
    m.add(state.tag_at(static_cast<std::size_t>(tag.local)), residual.H.leftCols<3>());
    m.add(state.tag_at(static_cast<std::size_t>(tag.local)) + 3, residual.H.rightCols<3>());
    return m;
  }
  // Through the body: X_VT = X_BV⁻¹ X_BT.
  const Pose& X_BV = state.X_BV[static_cast<std::size_t>(camera)];
  const Eigen::Matrix3d R_VB = X_BV.rotation().transpose();
  const Pose X_BT = tag_in_body(state, tag);
  Matrix86d H_BT;
  H_BT << residual.H.leftCols<3>() * R_VB, residual.H.rightCols<3>() * R_VB;
  m.add(extrinsics(camera), -H_BT.leftCols<3>());
  m.add(extrinsics(camera) + 3, H_BT.leftCols<3>() * skew(X_BT.p - X_BV.p) - H_BT.rightCols<3>());
  if (tag.local >= 0) {
    add_tag_blocks(m, state, tag.local, H_BT);
  } else {
    add_body_blocks(m, state, H_BT, X_BT);
    m.R = noise_of(state, tag, H_BT, corner_noise_px);
  }
  return m;
}

void measure_image(const FilterState& state, int camera, const CameraModel& model,
                   std::span<const TagToUse> tags, const CornerNoise& noise,
                   ImageMeasurement& out) {
  out.tags.clear();
  for (const TagToUse& tag : tags)
    out.tags.push_back(measure(state, camera, model, tag, noise.of(*tag.seen)));
}

}  // namespace fiducap::robocentric
