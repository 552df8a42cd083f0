#include "estimation/filter/matrix6.hpp"
#include "estimation/robocentric/filter_state.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>

#include "detection/tag_geometry.hpp"

namespace fiducap::robocentric {

using namespace layout;  // NOLINT: block names

namespace {
/// Tag in B axes by the state.
Pose tag_in_body(const FilterState& state, const TagToUse& tag) {
  if (tag.local >= 0) return state.X_BV[0] * state.tags[static_cast<std::size_t>(tag.local)].X_VT;
  return state.X_WB().inverse() * tag.known->X_WT;
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

/// Derivative of X_WT by position, attitude, extrinsics of camera 0 and the tag itself; position
/// and rotation in W axes.
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

Pose finish(FilterState& state, const Eigen::Quaterniond& q_new, const Eigen::Vector3d& p_new_B) {
  const Pose before = state.X_WB();
  state.q_WB = q_new.normalized();
  state.p_WB_B = p_new_B;
  return state.X_WB() * before.inverse();
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
  m.R = Matrix8d::Identity() * corner_noise_px * corner_noise_px;
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
    const Matrix83d H_p = H_BT.leftCols<3>();
    const Matrix83d H_q = H_BT.rightCols<3>();
    m.add(kPosition, -H_p);
    m.add(kAttitude, H_p * skew(X_BT.p + state.p_WB_B) - H_q);
    // The given pose is not in the state.
    const Matrix6d B_from_W = turn_of_pose_error(state.q_WB.conjugate().toRotationMatrix());
    const Matrix86d H = H_BT * B_from_W;
    m.R.noalias() += H * tag.known->covariance * H.transpose();
  }
  return m;
}

std::vector<SightedTag> tags_at_start(const FilterState& state, int camera,
                                      const CameraModel& model, std::span<const TagToUse> tags) {
  std::vector<SightedTag> sighted;
  for (const TagToUse& tag : tags) {
    const Pose X_B0T = tag_in_body(state, tag);
    sighted.push_back({tag.seen, &model, state.X_BV[static_cast<std::size_t>(camera)], X_B0T});
  }
  return sighted;
}

void measure_image(const FilterState& state, int camera, const CameraModel& model,
                   std::span<const TagToUse> tags, const CornerNoise& noise,
                   ImageMeasurement& out) {
  out.tags.clear();
  for (const TagToUse& tag : tags)
    out.tags.push_back(measure(state, camera, model, tag, noise.of(*tag.seen)));
}

void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen,
             const Pose& X_VT, double corner_noise_px) {
  const CornerResidual residual = corner_residual(seen, X_VT, model);
  const Matrix6d information =
      residual.H.transpose() * residual.H / (corner_noise_px * corner_noise_px);
  const Matrix6d own = inverse6(information);

  LocalTag tag{{.tag_id = seen.tag_id, .edge_m = seen.edge_m, .sightings = 1}, X_VT};
  if (camera == 0) return state.add_tag(tag, own);
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
  const Matrix6d turn = turn_of_pose_error(R_V0Vc);
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
  for (const LinearTerm& a : terms)
    for (const LinearTerm& b : terms)
      out.covariance.noalias() += a.J * P.block<3, 3>(a.at, b.at) * b.J.transpose();
  return out;
}

Pose anchor_to_reference(FilterState& state, std::size_t tag, const HeadingRule& rule, bool level) {
  const Pose& X_BV = state.X_BV[0];
  const Pose& X_VT = state.tags[tag].X_VT;
  const Pose X_BT = X_BV * X_VT;
  const Eigen::Matrix3d R_BV = X_BV.rotation();
  const Eigen::Vector3d arm_B = X_BV.q * X_VT.p;
  const int t = state.tag_at(tag);
  const int e = extrinsics(0);

  Eigen::Quaterniond q_new = rule.X_WT.q * X_BT.q.conjugate();
  // δφ_new by (φ, rotation of the tag in B axes): whole attitude by the tag …
  Eigen::Matrix3d from_tilt = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d from_turn = -Eigen::Matrix3d::Identity();
  if (level) {
    // … or only its heading ψ, that of the tag's level axis h.
    const Eigen::Matrix3d R_WB = state.q_WB.toRotationMatrix();
    const Eigen::Vector3d h = R_WB * (X_BT.q * Eigen::Vector3d::Unit(rule.axis));
    q_new = turn_to_heading(rule, state.q_WB * X_BT.q) * state.q_WB;
    const double level2 = h.x() * h.x() + h.y() * h.y();
    const Eigen::RowVector3d yaw_from_h(-h.y() / level2, h.x() / level2, 0);
    const Eigen::RowVector3d yaw_from_turn =
        -yaw_from_h * skew(h) * R_WB;  // h turns with the tag, in B axes
    const Eigen::Vector3d up_B = q_new.conjugate() * Eigen::Vector3d::UnitZ();
    from_turn = -up_B * yaw_from_turn;
    from_tilt = Eigen::Matrix3d::Identity() + from_turn;
  }
  const Eigen::Vector3d place_B = q_new.conjugate() * rule.X_WT.p;
  const Eigen::Matrix3d place_turn = skew(place_B);

  std::array<LinearTerm, 5> terms;
  const Eigen::Matrix3d tag_turn = from_turn * R_BV;
  terms[0] = linear_term(kAttitude, place_turn * from_tilt, from_tilt);
  terms[1] = linear_term(e, -Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero());
  terms[2] = linear_term(e + 3, skew(arm_B) + place_turn * from_turn, from_turn);
  terms[3] = linear_term(t, -R_BV, Eigen::Matrix3d::Zero());
  terms[4] = linear_term(t + 3, place_turn * tag_turn, tag_turn);
  redefine(state.covariance, kPosition, kAttitude, terms, Matrix6d::Zero());
  return finish(state, q_new, place_B - X_BT.p);
}

Pose anchor_to_known(FilterState& state, int camera, const Pose& X_VT, const Pose& X_WT,
                     bool level) {
  const Pose X_BT = state.X_BV[static_cast<std::size_t>(camera)] * X_VT;
  Eigen::Quaterniond q_new = X_WT.q * X_BT.q.conjugate();
  Matrix6d noise = Matrix6d::Zero();
  noise.topLeftCorner<3, 3>().diagonal().setConstant(kUnknownPosition_m * kUnknownPosition_m);
  LinearTerm tilt{kAttitude, Eigen::Matrix<double, 6, 3>::Zero()};
  const double turn2 = kUnknownAngle_rad * kUnknownAngle_rad;
  if (level) {
    // The heading that comes closest to the tag's whole attitude.
    q_new = turn_closest(X_WT.q, state.q_WB * X_BT.q) * state.q_WB;
    const Eigen::Vector3d up_B = q_new.conjugate() * Eigen::Vector3d::UnitZ();
    tilt.J.bottomRows<3>() = Eigen::Matrix3d::Identity() - up_B * up_B.transpose();
    noise.bottomRightCorner<3, 3>() = turn2 * up_B * up_B.transpose();
  } else {
    noise.bottomRightCorner<3, 3>().diagonal().setConstant(turn2);
  }
  redefine(state.covariance, kPosition, kAttitude, {&tilt, 1}, noise);
  return finish(state, q_new, q_new.conjugate() * X_WT.p - X_BT.p);
}

Pose anchor_local_to_known(FilterState& state, std::size_t tag, const Pose& X_WT, bool level) {
  return anchor_to_known(state, 0, Pose(state.tags[tag].X_VT), X_WT, level);
}

}  // namespace fiducap::robocentric
