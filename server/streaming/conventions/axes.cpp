#include "streaming/conventions/axes.hpp"

#include <array>
#include <cmath>

namespace fiducap {

AxesChange::AxesChange(const OutputAxes& axes)
    : R_CW_(Eigen::Matrix3d::Identity()),
      q_CW_(Eigen::Quaterniond::Identity()),
      turns_world_(axes.up != UpAxis::kZ),
      turns_body_(turns_world_ && axes.scope == AxesScope::kWorldAndBody),
      units_per_m_(axes.units_per_m) {
  // Exact: axes are swapped or turned round, nothing is rounded.
  if (axes.up == UpAxis::kY) {
    R_CW_ << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    q_CW_ = Eigen::Quaterniond(std::sqrt(0.5), -std::sqrt(0.5), 0, 0);
  } else if (axes.up == UpAxis::kDown) {
    R_CW_ << 1, 0, 0, 0, -1, 0, 0, 0, -1;
    q_CW_ = Eigen::Quaterniond(0, 1, 0, 0);
  }
}

Pose AxesChange::pose(const Pose& X_WP) const {
  Eigen::Quaterniond q = X_WP.q;
  if (turns_world_) q = q_CW_ * q;
  if (turns_body_) q = q * q_CW_.conjugate();
  return {turns_world_ ? q.normalized() : q, length(X_WP.p)};
}

Eigen::Vector3d AxesChange::length(const Eigen::Vector3d& v_W) const {
  return units_per_m_ * (R_CW_ * v_W);
}

Eigen::Vector3d AxesChange::world_rate(const Eigen::Vector3d& w_W) const { return R_CW_ * w_W; }

Eigen::Vector3d AxesChange::body_rate(const Eigen::Vector3d& w_P) const {
  return turns_body_ ? Eigen::Vector3d(R_CW_ * w_P) : w_P;
}

Matrix12d AxesChange::covariance(const Matrix12d& P) const {
  if (!turns_world_ && units_per_m_ == 1.0) return P;
  // Position and velocity turn and scale, the attitude error lives in world axes, the body rate in
  // body axes.
  const Eigen::Matrix3d R_rate = turns_body_ ? R_CW_ : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  const std::array<Eigen::Matrix3d, 4> J{units_per_m_ * R_CW_, R_CW_, units_per_m_ * R_CW_, R_rate};
  Matrix12d changed;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      changed.block<3, 3>(3 * row, 3 * column) =
          J[row] * P.block<3, 3>(3 * row, 3 * column) * J[column].transpose();
    }
  }
  return changed;
}

BodyPose to_client(const BodyPose& body, const OutputAxes& axes) {
  const AxesChange change(axes);
  BodyPose out = body;
  out.X_WP = change.pose(body.X_WP);
  out.v_WP = change.length(body.v_WP);
  out.w_WP_P = change.body_rate(body.w_WP_P);
  out.a_WP = change.length(body.a_WP);
  out.covariance = change.covariance(body.covariance);
  return out;
}

}  // namespace fiducap
