#include "streaming/conventions/autopilot_axes.hpp"

#include <algorithm>
#include <cmath>

#include "streaming/conventions/protocol_conventions.hpp"

namespace fiducap {

namespace {

constexpr double kFullQualityPosition_m = 0.01;
constexpr double kFullQualityRotation_rad = 0.0175;
constexpr double kBestBlindQuality = 50;

/// W turned about the vertical so that its x axis points where its y axis did: east, north, up →
/// north, west, up.
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

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d S;
  S << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return S;
}

}  // namespace

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
  const BodyPose told =
      to_client(world == AutopilotWorld::kNed ? north_first(body) : body, kAutopilot);
  AutopilotOdometry out;
  out.p_NF = told.X_WP.p;
  out.q_NF = told.X_WP.q;
  if (out.q_NF.w() < 0) out.q_NF.coeffs() *= -1;
  out.v_NF = told.v_WP;
  out.v_NF_F = told.X_WP.q.conjugate() * told.v_WP;
  out.w_NF_F = told.w_WP_P;
  // Attitude errors turn about N's axes; roll and pitch are meant about the heading's.
  Matrix6d J = Matrix6d::Identity();
  J.bottomRightCorner<3, 3>() =
      Eigen::AngleAxisd(-roll_pitch_yaw(out.q_NF).z(), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  out.pose_covariance = J * told.covariance.topLeftCorner<6, 6>() * J.transpose();
  out.twist_covariance = body_twist_covariance(told);
  out.velocity_variance = told.covariance.diagonal().segment<3>(6);
  return out;
}

Eigen::Vector3d roll_pitch_yaw(const Eigen::Quaterniond& q) {
  const double sin_pitch = std::clamp(2 * (q.w() * q.y() - q.z() * q.x()), -1.0, 1.0);
  return {std::atan2(2 * (q.w() * q.x() + q.y() * q.z()), 1 - 2 * (q.x() * q.x() + q.y() * q.y())),
          std::asin(sin_pitch),
          std::atan2(2 * (q.w() * q.z() + q.x() * q.y()), 1 - 2 * (q.y() * q.y() + q.z() * q.z()))};
}

std::int8_t autopilot_quality(const BodyPose& body) {
  if (!body.valid) return -1;
  const double doubt = std::max(body.position_sigma_m() / kFullQualityPosition_m,
                                body.rotation_sigma_rad() / kFullQualityRotation_rad);
  double quality = doubt > 1 ? 100 / doubt : 100;
  if (body.state != BodyState::kTracking) quality = std::min(quality, kBestBlindQuality);
  return static_cast<std::int8_t>(std::clamp(std::isfinite(quality) ? quality : 1.0, 1.0, 100.0));
}

}  // namespace fiducap
