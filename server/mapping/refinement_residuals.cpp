#include "mapping/refinement_residuals.hpp"

#include <cmath>

#include <Eigen/LU>

#include "base/so3.hpp"

namespace fiducap {

SightingResidual sighting_residual(const TagObservation& seen, const CameraMount& camera,
                                   const Pose& X_WB, const Pose& X_WT) {
  SightingResidual out;
  const Pose X_VW = (X_WB * camera.X_BV).inverse();
  const CornerResidual corners = corner_residual(seen, X_VW * X_WT, camera.model);
  out.in_front = corners.in_front;
  if (!out.in_front) return out;
  const Eigen::Matrix3d R_VW = X_VW.rotation();
  const Eigen::Matrix<double, 8, 3> H_p = corners.H.leftCols<3>() * R_VW;
  const Eigen::Matrix<double, 8, 3> H_q = corners.H.rightCols<3>() * R_VW;
  out.y = corners.y;
  out.d_tag << -H_p, -H_q;
  // Turning the body about itself by δ swings the tag, p_WT − p_WB away, by −δ.
  out.d_body << H_p, H_q - H_p * skew(X_WT.p - X_WB.p);
  return out;
}

double robust_square(const Vector8d& y, double corner_noise_px) {
  return kLossBend * std::log1p(y.squaredNorm() / (corner_noise_px * corner_noise_px * kLossBend));
}

PriorResidual prior_residual(const Pose& X_WT, const Pose& X_WT_surveyed) {
  PriorResidual out;
  const Eigen::Vector3d turn = log_so3(X_WT.q * X_WT_surveyed.q.conjugate());
  out.y << X_WT.p - X_WT_surveyed.p, turn;
  out.d_tag.setIdentity();
  out.d_tag.bottomRightCorner<3, 3>() = left_jacobian_so3(turn).inverse();
  return out;
}

}  // namespace fiducap
