#include "streaming/conventions/axes.hpp"

#include <algorithm>
#include <cmath>

#include "streaming/conventions/protocol_conventions.hpp"

namespace fiducap {

namespace {

constexpr double kFullQualityPosition_m = 0.01;
constexpr double kFullQualityRotation_rad = 0.0175;
constexpr double kBestBlindQuality = 50;

/// W rotated about the vertical: east, north, up → north, west, up.
BodyPose north_first(const BodyPose& body) {
  Eigen::Matrix3d R;
  R << 0, 1, 0, -1, 0, 0, 0, 0, 1;  // exact: axes are swapped, nothing is rounded
  BodyPose out = body;
  out.X_WP = {
      (Eigen::Quaterniond(std::sqrt(0.5), 0, 0, -std::sqrt(0.5)) * body.X_WP.q).normalized(),
      R * body.X_WP.p};
  out.v_WP = R * body.v_WP;
  out.a_WP = R * body.a_WP;
  Matrix12d J = Matrix12d::Identity();
  for (int block = 0; block < 3; ++block) J.block<3, 3>(3 * block, 3 * block) = R;
  out.covariance = J * body.covariance * J.transpose();
  return out;
}

}  // namespace

AxesChange::AxesChange(const OutputAxes& axes)
    : R_CW_(Eigen::Matrix3d::Identity()),
      q_CW_(Eigen::Quaterniond::Identity()),
      turns_world_(axes.up != UpAxis::kZ),
      turns_body_(turns_world_ && axes.scope == AxesScope::kWorldAndBody),
      units_per_m_(axes.units_per_m) {
  // Exact: axes are swapped or reversed, nothing is rounded.
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
  // Position and velocity rotate and scale; attitude error in world axes, body rate in body axes.
  const Eigen::Matrix3d R_rate = turns_body_ ? R_CW_ : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  const std::array<Eigen::Matrix3d, 4> J{units_per_m_ * R_CW_, R_CW_, units_per_m_ * R_CW_, R_rate};
  Matrix12d changed;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column)
      changed.block<3, 3>(3 * row, 3 * column) =
          J[row] * P.block<3, 3>(3 * row, 3 * column) * J[column].transpose();
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

Matrix6d body_twist_covariance(const BodyPose& body) {
  // v_P = Rᵀ v_W with R = exp(θ) R̂: an attitude error θ (W) adds Rᵀ [v_W]ₓ θ.
  const Eigen::Matrix3d R_PW = body.X_WP.rotation().transpose();
  Eigen::Matrix<double, 6, 12> J = Eigen::Matrix<double, 6, 12>::Zero();
  J.block<3, 3>(0, 3) = R_PW * skew(body.v_WP);
  J.block<3, 3>(0, 6) = R_PW;
  J.block<3, 3>(3, 9).setIdentity();
  return J * body.covariance * J.transpose();
}

AutopilotOdometry to_autopilot(const BodyPose& body, AutopilotWorld world) {
  const BodyPose client =
      to_client(world == AutopilotWorld::kNed ? north_first(body) : body, kAutopilot);
  AutopilotOdometry out;
  out.p_NF = client.X_WP.p;
  out.q_NF = client.X_WP.q;
  if (out.q_NF.w() < 0) out.q_NF.coeffs() *= -1;
  out.v_NF = client.v_WP;
  out.v_NF_F = client.X_WP.q.conjugate() * client.v_WP;
  out.w_NF_F = client.w_WP_P;
  // Attitude errors are about N's axes; roll and pitch about those of the heading.
  Matrix6d J = Matrix6d::Identity();
  J.bottomRightCorner<3, 3>() =
      Eigen::AngleAxisd(-roll_pitch_yaw(out.q_NF).z(), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  out.pose_covariance = J * client.covariance.topLeftCorner<6, 6>() * J.transpose();
  out.twist_covariance = body_twist_covariance(client);
  out.velocity_variance = client.covariance.diagonal().segment<3>(6);
  return out;
}

Eigen::Vector3d roll_pitch_yaw(const Eigen::Quaterniond& q) {
  const double sin_pitch = std::clamp(2 * (q.w() * q.y() - q.z() * q.x()), -1.0, 1.0);
  return {std::atan2(2 * (q.w() * q.x() + q.y() * q.z()), 1 - 2 * (q.x() * q.x() + q.y() * q.y())),
          std::asin(sin_pitch),
          std::atan2(2 * (q.w() * q.z() + q.x() * q.y()), 1 - 2 * (q.y() * q.y() + q.z() * q.z()))};
}

Eigen::Vector3d xyz_angles(const Eigen::Matrix3d& R) {
  // Below this cosine of a2 the entries that a1 and a3 come from are rounding noise.
  constexpr double kGimbalLock = 1e-9;
  const double a2 = std::asin(std::clamp(R(0, 2), -1.0, 1.0));
  const bool locked = std::hypot(R(0, 0), R(0, 1)) < kGimbalLock;
  const double a1 = locked ? std::atan2(R(2, 1), R(1, 1)) : std::atan2(-R(1, 2), R(2, 2));
  const double a3 = locked ? 0.0 : std::atan2(-R(0, 1), R(0, 0));
  return {a1, a2, a3};
}

std::int8_t autopilot_quality(const BodyPose& body) {
  if (!body.valid) return -1;
  const double relative_sigma = std::max(body.position_sigma_m() / kFullQualityPosition_m,
                                         body.rotation_sigma_rad() / kFullQualityRotation_rad);
  double quality = relative_sigma > 1 ? 100 / relative_sigma : 100;
  if (body.state != BodyState::kTracking) quality = std::min(quality, kBestBlindQuality);
  return static_cast<std::int8_t>(std::clamp(std::isfinite(quality) ? quality : 1.0, 1.0, 100.0));
}

}  // namespace fiducap
