#include "estimation/robocentric/tag_augmentation.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>

#include "base/so3.hpp"
#include "detection/corner_projection.hpp"
#include "estimation/filter/linear_term.hpp"

namespace fiducap::robocentric {

using namespace layout;  // NOLINT: the block names are the subject of this file

namespace {

/// X_WT against position, attitude, extrinsics of camera 0 and the tag itself; position and
/// rotation in W axes.
std::array<LinearTerm, 6> workspace_terms(const FilterState& state, std::size_t tag) {
  const Pose& X_BV = state.X_BV[0];
  const Pose& X_VT = state.tags[tag].X_VT;
  const Pose X_BT = X_BV * X_VT;
  const Eigen::Matrix3d R_WB = state.q_WB.toRotationMatrix();
  const Eigen::Matrix3d R_WV = R_WB * X_BV.rotation();
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  const Eigen::Vector3d arm_B = X_BV.q * X_VT.p;
  return {linear_term(kPosition, R_WB, zero),
          linear_term(kAttitude, -R_WB * skew(X_BT.p + state.p_WB_B), R_WB),
          linear_term(extrinsics(0), R_WB, zero),
          linear_term(extrinsics(0) + 3, -R_WB * skew(arm_B), R_WB),
          linear_term(state.tag_at(tag), R_WV, zero),
          linear_term(state.tag_at(tag) + 3, zero, R_WV)};
}

}  // namespace

void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen,
             const Pose& X_VT, double corner_noise_px) {
  const CornerResidual residual = corner_residual(seen, X_VT, model);
  const Matrix6d information =
      residual.H.transpose() * residual.H / (corner_noise_px * corner_noise_px);
  const Matrix6d own = information.inverse();

  LocalTag tag;
  tag.tag_id = seen.tag_id;
  tag.edge_m = seen.edge_m;
  tag.sightings = 1;
  if (camera == 0) {
    tag.X_VT = X_VT;
    state.add_tag(tag, own);
    return;
  }
  // X_V0T = X_BV0⁻¹ X_BVc X_VcT
  const Pose& X_BVc = state.X_BV[static_cast<std::size_t>(camera)];
  const Pose& X_BV0 = state.X_BV[0];
  tag.X_VT = X_BV0.inverse() * (X_BVc * X_VT);
  state.add_tag(tag, Matrix6d::Zero());
  const Eigen::Matrix3d R_V0B = X_BV0.rotation().transpose();
  const Eigen::Matrix3d R_V0Vc = R_V0B * X_BVc.rotation();
  const Eigen::Vector3d arm_B = X_BVc.q * X_VT.p;
  const Eigen::Vector3d lever_B = X_BVc.p + arm_B - X_BV0.p;
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  const std::array<LinearTerm, 4> terms{
      linear_term(extrinsics(camera), R_V0B, zero),
      linear_term(extrinsics(camera) + 3, -R_V0B * skew(arm_B), R_V0B),
      linear_term(extrinsics(0), -R_V0B, zero),
      linear_term(extrinsics(0) + 3, R_V0B * skew(lever_B), -R_V0B)};
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = R_V0Vc;
  turn.bottomRightCorner<3, 3>() = R_V0Vc;
  const int at = state.tag_at(state.tags.size() - 1);
  redefine(state.covariance, at, at + 3, terms, turn * own * turn.transpose());
}

void fuse_prior(FilterState& state, std::size_t tag, const KnownTag& prior) {
  const Pose X_WT = state.X_WB() * state.X_BV[0] * state.tags[tag].X_VT;
  Eigen::Matrix<double, 6, 1> y;
  y << prior.X_WT.p - X_WT.p, log_so3(prior.X_WT.q * X_WT.q.conjugate());
  const auto terms = workspace_terms(state, tag);
  auto P = state.P();
  Eigen::Matrix<double, Eigen::Dynamic, 6> PHt =
      Eigen::Matrix<double, Eigen::Dynamic, 6>::Zero(state.size(), 6);
  for (const LinearTerm& t : terms) PHt.noalias() += P.middleCols<3>(t.at) * t.J.transpose();
  Matrix6d S = prior.covariance;
  for (const LinearTerm& t : terms) S.noalias() += t.J * PHt.middleRows<3>(t.at);
  const Eigen::LDLT<Matrix6d> ldlt(S);
  const Eigen::VectorXd dx = PHt * ldlt.solve(y);
  const Eigen::MatrixXd correction = PHt * ldlt.solve(PHt.transpose());
  P -= 0.5 * (correction + correction.transpose());
  state.add_error(dx);
}

KnownTag tag_in_workspace(const FilterState& state, std::size_t tag) {
  KnownTag out;
  out.tag_id = state.tags[tag].tag_id;
  out.edge_m = state.tags[tag].edge_m;
  out.X_WT = state.X_WB() * state.X_BV[0] * state.tags[tag].X_VT;
  const auto terms = workspace_terms(state, tag);
  const auto P = state.P();
  for (const LinearTerm& a : terms) {
    for (const LinearTerm& b : terms)
      out.covariance.noalias() += a.J * P.block<3, 3>(a.at, b.at) * b.J.transpose();
  }
  return out;
}

}  // namespace fiducap::robocentric
