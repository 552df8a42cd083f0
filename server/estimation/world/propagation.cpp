#include "estimation/world/propagation.hpp"

#include "base/so3.hpp"

namespace fiducap::world {

using namespace layout;  // NOLINT: the block names are the subject of this file

namespace {
// Two clocks drift apart with temperature; after an hour by a millisecond at most.
constexpr double kShiftWalk_s_rts = 1e-5;

}  // namespace

// No row needs one that is changed before it.
void move_rows(const BodyMatrix& F, BodyMatrix& M) {
  const auto add = [&](int to, int from) {
    M.middleRows<3>(to) += F.block<3, 3>(to, from).lazyProduct(M.middleRows<3>(from));
  };
  for (const int from : {kAttitude, kVelocity, kBiasF, kBiasW}) add(kPosition, from);
  for (const int from : {kAttitude, kBiasF, kBiasW}) add(kVelocity, from);
  add(kAttitude, kBiasW);
}

StepJacobians step_mean(FilterState& state, const InertialInput& input,
                        const Eigen::Vector3d& gravity_W, double dt) {
  const Eigen::Vector3d w_B = input.w_B - state.bias_w;
  const Eigen::Vector3d f_B =
      input.has_accelerometer ? Eigen::Vector3d(input.f_B - state.bias_f) : Eigen::Vector3d::Zero();
  const Eigen::Vector3d g_W = input.has_accelerometer ? gravity_W : Eigen::Vector3d::Zero();
  const Eigen::Quaterniond q_half = state.X_WB.q * exp_so3(0.5 * dt * w_B);
  const Eigen::Matrix3d R_half = q_half.toRotationMatrix();
  const Eigen::Vector3d a_W = R_half * f_B + g_W;
  const double dt2 = 0.5 * dt * dt;

  state.gyro_B = input.w_B;
  state.a_WB = a_W;
  state.X_WB.p += dt * state.v_WB + dt2 * a_W;
  state.v_WB += dt * a_W;
  state.X_WB.q = (state.X_WB.q * exp_so3(dt * w_B)).normalized();

  // Gyro bias turns the body at the end of the step, and the force halfway.
  const Eigen::Matrix3d turn = -dt * (state.X_WB.rotation() * right_jacobian_so3(dt * w_B));
  const Eigen::Matrix3d a_gyro = 0.5 * dt * R_half * skew(f_B) * right_jacobian_so3(0.5 * dt * w_B);
  const Eigen::Matrix3d g_tilt = skew(g_W);
  StepJacobians out;
  auto& F = out.F;
  F.block<3, 3>(kAttitude, kBiasW) = turn;
  F.block<3, 3>(kVelocity, kAttitude) = dt * g_tilt;
  F.block<3, 3>(kVelocity, kBiasF) = -dt * R_half;
  F.block<3, 3>(kVelocity, kBiasW) = dt * a_gyro + skew(state.v_WB) * turn;
  F.block<3, 3>(kPosition, kVelocity) = dt * Eigen::Matrix3d::Identity();
  F.block<3, 3>(kPosition, kAttitude) = dt2 * g_tilt;
  F.block<3, 3>(kPosition, kBiasF) = -dt2 * R_half;
  F.block<3, 3>(kPosition, kBiasW) = dt2 * a_gyro + skew(state.X_WB.p) * turn;
  // White noise of the sensors enters like a change of their biases.
  out.G_w = F.middleCols<3>(kBiasW);
  out.G_w.middleRows<3>(kBiasW).setZero();
  out.G_f = F.middleCols<3>(kBiasF);
  out.G_f.middleRows<3>(kBiasF).setZero();
  if (!input.has_accelerometer) {
    // No sensor, no bias: only the white acceleration itself remains.
    F.middleCols<3>(kBiasF).setZero();
    F.block<3, 3>(kBiasF, kBiasF).setIdentity();
  }
  return out;
}

void propagate(FilterState& state, MotionSinceImage& motion, const InertialInput& input,
               const Eigen::Vector3d& gravity_W, double dt) {
  if (dt <= 0) return;
  if (!motion.begun) motion.X_WB_before = state.X_WB;
  motion.begun = true;
  const StepJacobians j = step_mean(state, input, gravity_W, dt);
  motion.seconds += dt;
  move_rows(j.F, motion.Phi);
  move_rows(j.F, motion.Q);
  motion.Q.transposeInPlace();  // F (F Q)ᵀ is F Q Fᵀ, for Q is symmetric
  move_rows(j.F, motion.Q);
  motion.Q.noalias() += (input.gyro_noise * input.gyro_noise / dt) * j.G_w * j.G_w.transpose();
  motion.Q.noalias() += (input.accel_noise * input.accel_noise / dt) * j.G_f * j.G_f.transpose();
  motion.Q.diagonal().segment<3>(kBiasF).array() += input.accel_walk * input.accel_walk * dt;
  motion.Q.diagonal().segment<3>(kBiasW).array() += input.gyro_walk * input.gyro_walk * dt;
}

void apply(FilterState& state, MotionSinceImage& motion) {
  if (!motion.begun) return;
  std::swap(state.X_WB, motion.X_WB_before);
  camera_errors_to_extrinsics(state);
  std::swap(state.X_WB, motion.X_WB_before);
  auto P = state.P();
  const Eigen::Index rest = state.size() - kBodySize;
  const BodyMatrix body = P.topLeftCorner<kBodySize, kBodySize>();
  P.topLeftCorner<kBodySize, kBodySize>() = motion.Phi * body * motion.Phi.transpose() + motion.Q;
  // Column by column, so that nothing is allocated.
  for (Eigen::Index k = kBodySize; k < kBodySize + rest; ++k) {
    const Eigen::Matrix<double, kBodySize, 1> moved = motion.Phi * P.col(k).head<kBodySize>();
    P.col(k).head<kBodySize>() = moved;
    P.row(k).head<kBodySize>() = moved.transpose();
  }
  for (int c = 0; c < state.cameras(); ++c) {
    double& shift = P(layout::clock(c), layout::clock(c));
    if (shift > 0) shift += kShiftWalk_s_rts * kShiftWalk_s_rts * motion.seconds;
  }
  extrinsics_to_camera_errors(state);
  motion.restart();
}

}  // namespace fiducap::world
