#include "estimation/world/tag_entry.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>

#include "base/so3.hpp"
#include "detection/corner_projection.hpp"
#include "estimation/filter/linear_term.hpp"
#include "estimation/world/corner_measurement.hpp"

namespace fiducap::world {

namespace {

Matrix86d pose_columns(const TagMeasurement& m, int at) {
  Matrix86d H = Matrix86d::Zero();
  for (std::size_t b = 0; b < m.block_count; ++b) {
    if (m.blocks[b].at == at) H.leftCols<3>() = m.blocks[b].H;
    if (m.blocks[b].at == at + 3) H.rightCols<3>() = m.blocks[b].H;
  }
  return H;
}

}  // namespace

void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen,
             const Pose& X_VT, double corner_noise_px) {
  WorldTag tag;
  tag.tag_id = seen.tag_id;
  tag.edge_m = seen.edge_m;
  tag.sightings = 1;
  const CameraClock& clock = state.clocks[static_cast<std::size_t>(camera)];
  tag.X_WT =
      state.X_WB_after(clock.seconds_to(0)) * state.X_BV[static_cast<std::size_t>(camera)] * X_VT;
  const int local = static_cast<int>(state.tags.size());
  state.add_tag(tag, Matrix6d::Zero());

  // The corners say: H_T ξ_T = y − Σ H_b ξ_b − n over the other blocks b. Solved for ξ_T.
  const TagMeasurement m = measure(state, camera, model, {&seen, local, nullptr}, corner_noise_px);
  const int at = state.tag_at(static_cast<std::size_t>(local));
  const Matrix86d H_T = pose_columns(m, at);
  const Matrix6d inverse = (H_T.transpose() * H_T).inverse();
  const Eigen::Matrix<double, 6, 8> solve = inverse * H_T.transpose();
  std::array<LinearTerm, TagMeasurement::kMaxBlocks> terms;
  std::size_t count = 0;
  for (std::size_t b = 0; b < m.block_count; ++b) {
    if (m.blocks[b].at < at) terms[count++] = {m.blocks[b].at, -solve * m.blocks[b].H};
  }
  redefine(state.covariance, at, at + 3, std::span(terms).first(count),
           corner_noise_px * corner_noise_px * inverse);
  // The mean is where the corners, linearised, say it is.
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  error.tail<6>() = solve * m.y;
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
