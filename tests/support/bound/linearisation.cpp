#include "support/bound/linearisation.hpp"

#include <Eigen/LU>
#include <cmath>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"
#include "estimation/filter/heading_rule.hpp"

namespace fiducap::bound {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Constant specific force (W axes) and attitude over the step: exact in dt for those.
Matrix15 transition(const Matrix3d& R, const Vector3d& force_W, double dt) {
  const Matrix3d turn = skew(force_W);
  Matrix15 Phi = Matrix15::Identity();
  Phi.block<3, 3>(kRotation, kBiasW) = -dt * R;
  Phi.block<3, 3>(kVelocity, kRotation) = -dt * turn;
  Phi.block<3, 3>(kVelocity, kBiasW) = 0.5 * dt * dt * turn * R;
  Phi.block<3, 3>(kVelocity, kBiasF) = -dt * R;
  Phi.block<3, 3>(kPosition, kRotation) = -0.5 * dt * dt * turn;
  Phi.block<3, 3>(kPosition, kVelocity) = dt * Matrix3d::Identity();
  Phi.block<3, 3>(kPosition, kBiasW) = dt * dt * dt / 6 * turn * R;
  Phi.block<3, 3>(kPosition, kBiasF) = -0.5 * dt * dt * R;
  return Phi;
}

Eigen::Matrix<double, 2, 3> pinhole_rows(const CameraModel& camera, const Vector3d& p_V) {
  const double z = p_V.z();
  Eigen::Matrix<double, 2, 3> J;
  J << camera.fu / z, 0, -camera.fu * p_V.x() / (z * z), 0, camera.fv / z,
      -camera.fv * p_V.y() / (z * z);
  return J;
}

}  // namespace

InertialStep inertial_step(const TruthSample& from, const TruthSample& to, const ImuNoise& noise,
                           double gravity_m_s2) {
  const double dt = to_seconds(to.at - from.at);
  FIDUCAP_ASSERT(dt > 0);
  const Vector3d force_W = (to.v_WB - from.v_WB) / dt + Vector3d(0, 0, gravity_m_s2);
  const Matrix3d R = from.X_WB.q.slerp(0.5, to.X_WB.q).toRotationMatrix();
  Eigen::Matrix<double, 15, 1> density = Eigen::Matrix<double, 15, 1>::Zero();
  const auto square = [](double x) { return x * x; };
  density.segment<3>(kRotation).setConstant(square(noise.gyro_noise_rad_s_rtHz));
  density.segment<3>(kVelocity).setConstant(square(noise.accel_noise_m_s2_rtHz));
  density.segment<3>(kBiasW).setConstant(square(noise.gyro_walk_rad_s2_rtHz));
  density.segment<3>(kBiasF).setConstant(square(noise.accel_walk_m_s3_rtHz));
  const Matrix15 G = density.asDiagonal();
  // Simpson's rule over the time at which the noise came in: exact for what a double integration of
  // it makes.
  const Matrix15 half = transition(R, force_W, 0.5 * dt);
  const Matrix15 whole = transition(R, force_W, dt);
  return {whole, dt / 6 * (G + 4 * half * G * half.transpose() + whole * G * whole.transpose())};
}

CornerRows corner_rows(const Pose& X_WB, const CameraMount& camera, const RecordedTag& tag,
                       double noise_px) {
  const Matrix3d R_WB = X_WB.rotation();
  const Matrix3d R_BV = camera.X_BV.rotation();
  CornerRows rows;
  for (int i = 0; i < 4; ++i) {
    const Vector3d arm_W = tag.X_WT.q * tag_corner(i, tag.edge_m);
    const Vector3d d_W = tag.X_WT.p + arm_W - X_WB.p;
    const Vector3d from_camera_B = R_WB.transpose() * d_W - camera.X_BV.p;
    const Vector3d p_V = R_BV.transpose() * from_camera_B;
    const auto raw = camera.model.project(p_V);
    FIDUCAP_ASSERT(raw.has_value());
    const auto ideal = undistort(camera.model, *raw);
    FIDUCAP_ASSERT(ideal.has_value());
    const Eigen::Matrix<double, 2, 3> by_B = ideal->ideal_from_raw.inverse() *
                                             pinhole_rows(camera.model, p_V) * R_BV.transpose() /
                                             noise_px;
    const Eigen::Matrix<double, 2, 3> by_W = by_B * R_WB.transpose();
    rows.rotation.middleRows<2>(2 * i) = by_W * skew(d_W);
    rows.position.middleRows<2>(2 * i) = -by_W;
    rows.extrinsics.block<2, 3>(2 * i, 0) = -by_B;
    rows.extrinsics.block<2, 3>(2 * i, 3) = by_B * skew(from_camera_B);
    rows.tag.block<2, 3>(2 * i, 0) = by_W;
    rows.tag.block<2, 3>(2 * i, 3) = -by_W * skew(arm_W);
  }
  return rows;
}

RelativeRows relative_to_tag(const Pose& X_WB, const Pose& X_WT) {
  const Matrix3d R_TW = X_WT.rotation().transpose();
  RelativeRows J = RelativeRows::Zero();
  J.block<3, 3>(0, 3) = R_TW;
  J.block<3, 3>(0, 6) = -R_TW;
  J.block<3, 3>(0, 9) = R_TW * skew(X_WB.p - X_WT.p);
  J.block<3, 3>(3, 0) = R_TW;
  J.block<3, 3>(3, 9) = -R_TW;
  return J;
}

Eigen::RowVector3d heading_row(const Eigen::Quaterniond& q_WT, int axis) {
  const Vector3d h = q_WT * Vector3d::Unit(axis);
  const double level2 = h.x() * h.x() + h.y() * h.y();
  const Eigen::RowVector3d yaw_from_h(-h.y() / level2, h.x() / level2, 0);
  return -yaw_from_h * skew(h);
}

RelativeRows relative_to_level(const Pose& X_WB, const Pose& X_WT, int axis) {
  const Eigen::RowVector3d yaw_from_tag = heading_row(X_WT.q, axis);
  RelativeRows J = RelativeRows::Zero();
  J.block<3, 3>(0, 3).setIdentity();
  J.block<3, 3>(0, 6) = -Matrix3d::Identity();
  J.block<3, 3>(0, 9) = skew(X_WB.p - X_WT.p) * Vector3d::UnitZ() * yaw_from_tag;
  J.block<3, 3>(3, 0).setIdentity();
  J.block<3, 3>(3, 9) = -Vector3d::UnitZ() * yaw_from_tag;
  return J;
}

int heading_axis(const Eigen::Quaterniond& q_WT) { return make_heading_rule({}, q_WT).axis; }

}  // namespace fiducap::bound
