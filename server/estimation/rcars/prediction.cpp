#include "estimation/rcars/equations.hpp"

namespace fiducap::rcars {

BodyStep step_body(State& x, const InertialInput& imu, const Eigen::Vector3d& g_W, double dt) {
  const Eigen::Vector3d w = imu.w_B - x.b_w;
  const Eigen::Vector3d f = imu.f_B - x.b_f;
  const Eigen::Quaterniond turn = exp_so3(w * dt);
  const Eigen::Matrix3d R_back = turn.conjugate().toRotationMatrix();  // old B axes → new B axes
  const Eigen::Matrix3d R_half = exp_so3(0.5 * dt * w).toRotationMatrix();
  const Eigen::Vector3d g_B = x.q.conjugate() * g_W;
  const Eigen::Vector3d a = R_half * f + g_B;
  x.r = R_back * (x.r + dt * x.v + 0.5 * dt * dt * a);
  x.v = R_back * (x.v + dt * a);
  x.q = (x.q * turn).normalized();

  const Eigen::Matrix3d turn_by_bw = -dt * right_jacobian_so3(w * dt);
  const Eigen::Matrix3d a_by_bw = 0.5 * dt * R_half * skew(f) * right_jacobian_so3(0.5 * dt * w);
  BodyStep out;
  auto& F = out.F;
  F.block<3, 3>(kR, kR) = F.block<3, 3>(kQ, kQ) = F.block<3, 3>(kV, kV) = R_back;
  F.block<3, 3>(kR, kV) = dt * R_back;
  F.block<3, 3>(kQ, kBw) = turn_by_bw;
  const auto add_acceleration = [&](int row, double share, const Eigen::Vector3d& turned) {
    F.block<3, 3>(row, kQ) = share * R_back * skew(g_B);
    F.block<3, 3>(row, kBf) = -share * R_back * R_half;
    F.block<3, 3>(row, kBw) = share * R_back * a_by_bw + skew(turned) * turn_by_bw;
  };
  add_acceleration(kR, 0.5 * dt * dt, x.r);
  add_acceleration(kV, dt, x.v);
  // White noise acts like minus a bias.
  out.G_w = F.middleCols<3>(kBw);
  out.G_f = F.middleCols<3>(kBf);
  out.G_w.middleRows<3>(kBw).setZero();
  out.G_f.middleRows<3>(kBf).setZero();
  return out;
}

void Prediction::step(State& x, const InertialInput& imu, const Eigen::Vector3d& g_W, double dt) {
  const BodyStep body = step_body(x, imu, g_W, dt);
  Phi_ = (body.F * Phi_).eval();
  Q_ = (body.F * Q_ * body.F.transpose()).eval();
  Q_ += (imu.gyro_noise * imu.gyro_noise / dt) * body.G_w * body.G_w.transpose();
  Q_ += (imu.accel_noise * imu.accel_noise / dt) * body.G_f * body.G_f.transpose();
  Q_.diagonal().segment<3>(kBf).array() += imu.accel_walk * imu.accel_walk * dt;
  Q_.diagonal().segment<3>(kBw).array() += imu.gyro_walk * imu.gyro_walk * dt;
}

/// A tag stands still in W, which integrates the equations of r_T and q_T exactly:
/// X_VT ← X_VB X_BW X_WB0 X_B0V X_VT.
void Prediction::finish(State& x) {
  constexpr int kBefore = kOutside;  // the body at the last image
  const LinearPose X_WB0 = inverse({X_B0W_, {{kBefore, -Matrix6d::Identity()}}});
  const LinearPose X_VV0 = inverse(x.X_BV(0)) * x.X_BW() * X_WB0 * x.X_BV(0);
  const int size = x.size();
  const int camera = x.camera_at(0);
  // The error of the whole state is F δ + G n, n the noise of the body; F by rows of each tag.
  struct TagRows {
    Matrix6d by_tag, by_camera;
    Eigen::Matrix<double, 6, kBodySize> by_body;
  };
  std::vector<TagRows> F(x.tags.size());
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(size, kBodySize);
  G.topRows<kBodySize>().setIdentity();
  for (std::size_t i = 0; i < F.size(); ++i) {
    const LinearPose X_VT = X_VV0 * x.X_VT(i);
    F[i] = {X_VT.by(x.tag_at(i)), X_VT.by(camera), X_VT.by(kR) * Phi_.topRows<6>()};
    F[i].by_body.leftCols<6>() += X_VT.by(kBefore);
    G.block<6, 6>(x.tag_at(i), kR) = X_VT.by(kR);
    x.tags[i].X_VT = X_VT.X;
  }
  // P ← F (P Fᵀ) + G Q Gᵀ, never with a dense F.
  for (int side = 0; side < 2; ++side) {
    for (std::size_t i = 0; i < F.size(); ++i) {
      auto columns = x.P.middleCols<6>(x.tag_at(i));
      columns = (columns * F[i].by_tag.transpose() +
                 x.P.middleCols<6>(camera) * F[i].by_camera.transpose() +
                 x.P.leftCols<kBodySize>() * F[i].by_body.transpose())
                    .eval();
    }
    x.P.leftCols<kBodySize>() = (x.P.leftCols<kBodySize>() * Phi_.transpose()).eval();
    x.P.transposeInPlace();
  }
  x.P.noalias() += G * Q_ * G.transpose();
  x.P = (0.5 * (x.P + x.P.transpose())).eval();
}

}  // namespace fiducap::rcars
