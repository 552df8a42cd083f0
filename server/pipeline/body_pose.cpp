#include "pipeline/body_pose.hpp"

#include <cmath>

namespace fiducap {

double BodyPose::position_sigma_m() const {
  return std::sqrt(covariance.diagonal().segment<3>(0).maxCoeff());
}

double BodyPose::rotation_sigma_rad() const {
  return std::sqrt(covariance.diagonal().segment<3>(3).maxCoeff());
}

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Blocks of BodyPose::covariance.
constexpr int kPivotPosition = 0;
constexpr int kPivotAttitude = 3;
constexpr int kPivotVelocity = 6;
constexpr int kPivotRate = 9;

Matrix12d pivot_covariance(const BodyEstimate& body, const Pose& X_BP, double rate_variance) {
  using namespace estimate_block;
  const Matrix3d R_WB = body.X_WB.rotation();
  const Matrix3d R_PB = X_BP.rotation().transpose();
  const Vector3d arm_W = R_WB * X_BP.p;
  const Vector3d arm_velocity_W = R_WB * body.w_WB_B.cross(X_BP.p);
  const Matrix3d velocity_from_rate = -R_WB * skew(X_BP.p);

  // A body rate error is minus the error of bias_w.
  Eigen::Matrix<double, 12, 15> J = Eigen::Matrix<double, 12, 15>::Zero();
  J.block<3, 3>(kPivotPosition, kPosition).setIdentity();
  J.block<3, 3>(kPivotPosition, kAttitude) = -skew(arm_W);
  J.block<3, 3>(kPivotAttitude, kAttitude).setIdentity();
  J.block<3, 3>(kPivotVelocity, kAttitude) = -skew(arm_velocity_W);
  J.block<3, 3>(kPivotVelocity, kVelocity).setIdentity();
  J.block<3, 3>(kPivotVelocity, kBiasW) = -velocity_from_rate;
  J.block<3, 3>(kPivotRate, kBiasW) = -R_PB;

  const Eigen::Matrix<double, 12, 15> JP = J * body.covariance;
  Matrix12d covariance = JP * J.transpose();
  Eigen::Matrix<double, 6, 3> noise;
  noise << velocity_from_rate, R_PB;
  covariance.bottomRightCorner<6, 6>() += rate_variance * noise * noise.transpose();
  return covariance;
}

}  // namespace

void write_pivot(const BodyEstimate& body, const Pose& X_BP, double rate_variance, BodyPose& out) {
  const Vector3d arm_velocity_B = body.w_WB_B.cross(X_BP.p);
  out.X_WP = body.X_WB * X_BP;
  out.v_WP = body.v_WB + body.X_WB.q * arm_velocity_B;
  out.w_WP_P = X_BP.q.conjugate() * body.w_WB_B;
  out.a_WP = body.a_WB + body.X_WB.q * body.w_WB_B.cross(arm_velocity_B);
  out.covariance = pivot_covariance(body, X_BP, rate_variance);
}

}  // namespace fiducap
