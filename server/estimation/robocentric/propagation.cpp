#include "estimation/robocentric/propagation.hpp"

#include "base/so3.hpp"

namespace fiducap::robocentric {

using namespace layout;  // NOLINT: the block names are the subject of this file

StepJacobians step_mean(FilterState& state, MotionSinceImage& motion, const InertialInput& input,
                        const Eigen::Vector3d& gravity_W, double dt) {
  const Eigen::Vector3d w_B = input.w_B - state.bias_w;
  const Eigen::Vector3d f_B = input.f_B - state.bias_f;
  const Eigen::Quaterniond turn = exp_so3(w_B * dt);
  const Eigen::Matrix3d R_back = turn.conjugate().toRotationMatrix();  // old B axes → new B axes
  const Eigen::Matrix3d R_half = exp_so3(0.5 * dt * w_B).toRotationMatrix();
  const Eigen::Vector3d g_B = state.q_WB.conjugate() * gravity_W;
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const Eigen::Vector3d a_B = input.has_accelerometer ? Eigen::Vector3d(R_half * f_B + g_B) : zero;
  const Eigen::Vector3d step_B = state.v_WB_B * dt + 0.5 * dt * dt * a_B;

  state.p_WB_B = R_back * (state.p_WB_B + step_B);
  state.v_WB_B = R_back * (state.v_WB_B + dt * a_B);
  state.q_WB = (state.q_WB * turn).normalized();
  motion.X_B0B = {(motion.X_B0B.q * turn).normalized(), motion.X_B0B.p + motion.X_B0B.q * step_B};

  // Acceleration against tilt, accelerometer bias and gyro bias; a white acceleration enters like
  // minus a bias.
  const Eigen::Matrix3d a_tilt = input.has_accelerometer ? skew(g_B) : Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d a_force = -R_half;
  const Eigen::Matrix3d a_gyro = input.has_accelerometer
                                     ? Eigen::Matrix3d(0.5 * dt * R_half * skew(f_B))
                                     : Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d turn_gyro = -dt * right_jacobian_so3(w_B * dt);
  const double dt2 = 0.5 * dt * dt;

  StepJacobians out;
  auto& F = out.F;
  F.block<3, 3>(kPosition, kPosition) = R_back;
  F.block<3, 3>(kPosition, kVelocity) = dt * R_back;
  F.block<3, 3>(kPosition, kAttitude) = dt2 * R_back * a_tilt;
  F.block<3, 3>(kPosition, kBiasF) = dt2 * R_back * a_force;
  F.block<3, 3>(kPosition, kBiasW) = dt2 * R_back * a_gyro + skew(state.p_WB_B) * turn_gyro;
  F.block<3, 3>(kVelocity, kVelocity) = R_back;
  F.block<3, 3>(kVelocity, kAttitude) = dt * R_back * a_tilt;
  F.block<3, 3>(kVelocity, kBiasF) = dt * R_back * a_force;
  F.block<3, 3>(kVelocity, kBiasW) = dt * R_back * a_gyro + skew(state.v_WB_B) * turn_gyro;
  F.block<3, 3>(kAttitude, kAttitude) = R_back;
  F.block<3, 3>(kAttitude, kBiasW) = turn_gyro;
  F.block<3, 3>(kStepPosition, kStepPosition) = R_back;
  F.block<3, 3>(kStepPosition, kStepAttitude) = -R_back * skew(step_B);
  F.block<3, 3>(kStepPosition, kVelocity) = dt * R_back;
  F.block<3, 3>(kStepPosition, kAttitude) = dt2 * R_back * a_tilt;
  F.block<3, 3>(kStepPosition, kBiasF) = dt2 * R_back * a_force;
  F.block<3, 3>(kStepPosition, kBiasW) = dt2 * R_back * a_gyro;
  F.block<3, 3>(kStepAttitude, kStepAttitude) = R_back;
  F.block<3, 3>(kStepAttitude, kBiasW) = turn_gyro;

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
  const StepJacobians j = step_mean(state, motion, input, gravity_W, dt);
  motion.Phi = (j.F * motion.Phi).eval();
  motion.Q = (j.F * motion.Q * j.F.transpose()).eval();
  motion.Q.noalias() += (input.gyro_noise * input.gyro_noise / dt) * j.G_w * j.G_w.transpose();
  motion.Q.noalias() += (input.accel_noise * input.accel_noise / dt) * j.G_f * j.G_f.transpose();
  motion.Q.diagonal().segment<3>(kBiasF).array() += input.accel_walk * input.accel_walk * dt;
  motion.Q.diagonal().segment<3>(kBiasW).array() += input.gyro_walk * input.gyro_walk * dt;
}

}  // namespace fiducap::robocentric
