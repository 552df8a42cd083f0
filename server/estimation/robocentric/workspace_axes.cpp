#include "estimation/robocentric/workspace_axes.hpp"

#include <array>

#include "base/so3.hpp"
#include "estimation/filter/linear_term.hpp"

namespace fiducap::robocentric {

using namespace layout;  // NOLINT: the block names are the subject of this file

namespace {

Pose finish(FilterState& state, const Eigen::Quaterniond& q_new, const Eigen::Vector3d& p_new_B) {
  const Pose before = state.X_WB();
  state.q_WB = q_new.normalized();
  state.p_WB_B = p_new_B;
  return state.X_WB() * before.inverse();
}

}  // namespace

Pose anchor_to_reference(FilterState& state, std::size_t tag, const HeadingRule& rule, bool level) {
  const Pose& X_BV = state.X_BV[0];
  const Pose& X_VT = state.tags[tag].X_VT;
  const Pose X_BT = X_BV * X_VT;
  const Eigen::Matrix3d R_BV = X_BV.rotation();
  const Eigen::Vector3d arm_B = X_BV.q * X_VT.p;
  const int t = state.tag_at(tag);
  const int e = extrinsics(0);

  Eigen::Quaterniond q_new = rule.X_WT.q * X_BT.q.conjugate();
  // δφ_new in terms of (φ, rotation of the tag in B axes): whole attitude by the tag …
  Eigen::Matrix3d from_tilt = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d from_turn = -Eigen::Matrix3d::Identity();
  if (level) {
    // … or only its heading: ψ shifts by what the tag's level axis h says.
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
