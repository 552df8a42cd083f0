#include "estimation/world/tag_entry.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>

#include "base/so3.hpp"
#include "detection/corner_projection.hpp"
#include "estimation/linear_term.hpp"

namespace fiducap::world {

using namespace layout;  // NOLINT: the block names are the subject of this file

void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen, const Pose& X_VT,
             double corner_noise_px) {
  const CornerResidual residual = corner_residual(seen, X_VT, model);
  const Matrix6d own = (residual.H.transpose() * residual.H / (corner_noise_px * corner_noise_px)).inverse();

  const Pose& X_BV = state.X_BV[static_cast<std::size_t>(camera)];
  WorldTag tag;
  tag.tag_id = seen.tag_id;
  tag.edge_m = seen.edge_m;
  tag.sightings = 1;
  tag.X_WT = state.X_WB * X_BV * X_VT;
  state.add_tag(tag, Matrix6d::Zero());

  const Eigen::Matrix3d R_WB = state.X_WB.rotation();
  const Eigen::Matrix3d R_WV = R_WB * X_BV.rotation();
  const Eigen::Matrix3d lever = skew(tag.X_WT.p);
  const Eigen::Vector3d arm_B = X_BV.q * X_VT.p;
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
  const std::array<LinearTerm, 4> terms{
      linear_term(kPosition, one, zero), linear_term(kAttitude, zero, one),
      linear_term(extrinsics(camera), R_WB, zero),
      linear_term(extrinsics(camera) + 3, lever * R_WB - R_WB * skew(arm_B), R_WB)};
  Matrix6d seen_to_world = Matrix6d::Zero();
  seen_to_world << R_WV, lever * R_WV, zero, R_WV;
  const int at = state.tag_at(state.tags.size() - 1);
  redefine(state.covariance, at, at + 3, terms, seen_to_world * own * seen_to_world.transpose());
}

void hold(FilterState& state, const KnownTag& known, Instant at) {
  WorldTag tag;
  tag.tag_id = known.tag_id;
  tag.edge_m = known.edge_m;
  tag.X_WT = known.X_WT;
  tag.held = true;
  tag.first_seen = at;
  tag.last_seen = at;
  const Matrix6d J = world_from_plain_error(known.X_WT.p);
  state.add_tag(tag, J * known.covariance * J.transpose());
}

void fuse_prior(FilterState& state, std::size_t tag, const KnownTag& prior) {
  const Pose& X_WT = state.tags[tag].X_WT;
  Eigen::Matrix<double, 6, 1> y;
  y << prior.X_WT.p - X_WT.p, log_so3(prior.X_WT.q * X_WT.q.conjugate());
  const Matrix6d H = plain_from_world_error(X_WT.p);
  const int at = state.tag_at(tag);
  auto P = state.P();
  const Eigen::Matrix<double, Eigen::Dynamic, 6> PHt = P.middleCols<6>(at) * H.transpose();
  const Eigen::LDLT<Matrix6d> S(H * PHt.middleRows<6>(at) + prior.covariance);
  const Eigen::VectorXd dx = PHt * S.solve(y);
  const Eigen::MatrixXd correction = PHt * S.solve(PHt.transpose());
  P -= 0.5 * (correction + correction.transpose());
  state.add_error(dx);
}

}  // namespace fiducap::world
