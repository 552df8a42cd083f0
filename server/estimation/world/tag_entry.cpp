#include "estimation/world/tag_entry.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>

#include "base/so3.hpp"
#include "detection/corner_projection.hpp"
#include "estimation/linear_term.hpp"

namespace fiducap::world {

void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen, const Pose& X_VT,
             double corner_noise_px) {
  const CornerResidual residual = corner_residual(seen, X_VT, model);
  const Matrix6d inverse = (residual.H.transpose() * residual.H).inverse();
  const Matrix6d own = corner_noise_px * corner_noise_px * inverse;
  const Eigen::Matrix<double, 6, 1> beside = inverse * residual.H.transpose() * residual.y;

  const Pose X_WV = state.X_WV(camera);
  WorldTag tag;
  tag.tag_id = seen.tag_id;
  tag.edge_m = seen.edge_m;
  tag.sightings = 1;
  tag.X_WT = X_WV * X_VT;
  state.add_tag(tag, Matrix6d::Zero());

  const Eigen::Matrix3d R_WV = X_WV.rotation();
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
  const std::array<LinearTerm, 2> terms{linear_term(layout::camera(camera), one, zero),
                                        linear_term(layout::camera(camera) + 3, zero, one)};
  Matrix6d seen_to_world = Matrix6d::Zero();
  seen_to_world << R_WV, skew(tag.X_WT.p) * R_WV, zero, R_WV;
  const int at = state.tag_at(state.tags.size() - 1);
  redefine(state.covariance, at, at + 3, terms, seen_to_world * own * seen_to_world.transpose());
  // The mean is where the corners, linearised, say it is.
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  error.tail<6>() = seen_to_world * beside;
  state.add_error(error);
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
