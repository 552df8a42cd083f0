#include "streaming/conventions/autopilot_axes.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {

constexpr double kFullQualityPosition_m = 0.01;
constexpr double kFullQualityRotation_rad = 0.0175;
constexpr double kBestBlindQuality = 50;

Eigen::Matrix3d world_change(AutopilotWorld world) {
  Eigen::Matrix3d R_NW;
  if (world == AutopilotWorld::kNed) {
    R_NW << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  } else {
    R_NW << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  }
  return R_NW;
}

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d S;
  S << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return S;
}

/// J C Jᵀ for the position–attitude block, J = diag(A, B).
Matrix6d turned(const Matrix6d& C, const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
  Matrix6d out;
  out << A * C.topLeftCorner<3, 3>() * A.transpose(), A * C.topRightCorner<3, 3>() * B.transpose(),
      B * C.bottomLeftCorner<3, 3>() * A.transpose(), B * C.bottomRightCorner<3, 3>() * B.transpose();
  return out;
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
  const Eigen::Matrix3d R_NW = world_change(world);
  const Eigen::Vector3d flip(1, -1, -1);  // P (forward, left, up) ↔ F (forward, right, down)
  const Eigen::Matrix3d R_FP = flip.asDiagonal();
  AutopilotOdometry out;
  out.p_NF = R_NW * body.X_WP.p;
  out.q_NF = Eigen::Quaterniond(R_NW * body.X_WP.rotation() * R_FP).normalized();
  if (out.q_NF.w() < 0) out.q_NF.coeffs() *= -1;
  out.v_NF = R_NW * body.v_WP;
  out.v_NF_F = R_FP * (body.X_WP.q.conjugate() * body.v_WP);
  out.w_NF_F = R_FP * body.w_WP_P;
  const double yaw = roll_pitch_yaw(out.q_NF).z();
  const Eigen::Matrix3d to_heading = Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix() * R_NW;
  out.pose_covariance = turned(body.covariance.topLeftCorner<6, 6>(), R_NW, to_heading);
  out.twist_covariance = turned(body_twist_covariance(body), R_FP, R_FP);
  out.velocity_variance = (R_NW * body.covariance.block<3, 3>(6, 6) * R_NW.transpose()).diagonal();
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
