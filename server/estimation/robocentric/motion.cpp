#include "estimation/robocentric/motion.hpp"

#include "estimation/filter/heading_rule.hpp"

namespace fiducap::robocentric {

using namespace layout;  // NOLINT: block names

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

MotionSinceImage step_by_unknown_motion(FilterState& state, const Pose& X_B0B, bool has_imu) {
  const Eigen::Matrix3d R_back = X_B0B.rotation().transpose();
  state.p_WB_B = R_back * (state.p_WB_B + X_B0B.p);
  state.q_WB = (state.q_WB * X_B0B.q).normalized();
  state.v_WB_B.setZero();
  MotionSinceImage motion;
  motion.X_B0B = X_B0B;
  motion.Phi.block<3, 3>(kPosition, kPosition) = R_back;
  motion.Phi.block<3, 3>(kAttitude, kAttitude) = R_back;
  motion.Phi.block<3, 3>(kVelocity, kVelocity).setZero();
  Eigen::Matrix<double, kMotionSize, 6> from_step = Eigen::Matrix<double, kMotionSize, 6>::Zero();
  from_step.block<3, 3>(kPosition, 0).setIdentity();
  from_step.block<3, 3>(kPosition, 3) = skew(state.p_WB_B);
  from_step.block<3, 3>(kAttitude, 3).setIdentity();
  from_step.block<6, 6>(kStepPosition, 0).setIdentity();
  Matrix6d S = Matrix6d::Zero();
  S.diagonal() << Eigen::Vector3d::Constant(kUnknownPosition_m * kUnknownPosition_m),
      Eigen::Vector3d::Constant(kUnknownAngle_rad * kUnknownAngle_rad);
  motion.Q = from_step * S * from_step.transpose();
  motion.Q.diagonal().segment<3>(kVelocity).setConstant(kStartVelocity_m_s * kStartVelocity_m_s);
  if (!has_imu) {
    state.bias_w.setZero();
    motion.Phi.block<3, 3>(kBiasW, kBiasW).setZero();
    motion.Q.diagonal().segment<3>(kBiasW).setConstant(kStartRate_rad_s * kStartRate_rad_s);
  }
  return motion;
}

FrameTransition::TagMove FrameTransition::move_tag(const Pose& X_BV, const Pose& X_B0B,
                                                   Pose& X_VT) {
  // T in V0 → in B0 (extrinsics) → in B (step undone) → in V (extrinsics undone); errors follow the
  // same path.
  const Eigen::Matrix3d R_BV = X_BV.rotation();
  const Eigen::Matrix3d R_BB0 = X_B0B.rotation().transpose();
  const Eigen::Vector3d arm_B0 = X_BV.q * X_VT.p;
  const Pose X_BT = X_B0B.inverse() * (X_BV * X_VT);
  const Eigen::Vector3d lever_B = X_BT.p - X_BV.p;

  Matrix6d from_tag = Matrix6d::Zero();  // ∂ X_BT / ∂ tag
  from_tag.topLeftCorner<3, 3>() = R_BB0 * R_BV;
  from_tag.bottomRightCorner<3, 3>() = R_BB0 * R_BV;
  Matrix6d from_step = Matrix6d::Zero();  // ∂ X_BT / ∂ step
  from_step.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity();
  from_step.topRightCorner<3, 3>() = skew(X_BT.p);
  from_step.bottomRightCorner<3, 3>() = -Eigen::Matrix3d::Identity();
  Matrix6d from_extrinsics = Matrix6d::Zero();  // ∂ X_BT / ∂ extrinsics, on the way in
  from_extrinsics.topLeftCorner<3, 3>() = R_BB0;
  from_extrinsics.topRightCorner<3, 3>() = -R_BB0 * skew(arm_B0);
  from_extrinsics.bottomRightCorner<3, 3>() = R_BB0;
  // ... and on the way out:
  from_extrinsics.topLeftCorner<3, 3>() -= Eigen::Matrix3d::Identity();
  from_extrinsics.topRightCorner<3, 3>() += skew(lever_B);
  from_extrinsics.bottomRightCorner<3, 3>() -= Eigen::Matrix3d::Identity();

  const Matrix6d to_camera = turn_of_pose_error(R_BV.transpose());

  TagMove move;
  move.A = to_camera * from_tag;
  move.M << to_camera * from_step, to_camera * from_extrinsics;
  X_VT = X_BV.inverse() * X_BT;
  return move;
}

void FrameTransition::apply(FilterState& state, MotionSinceImage& motion) {
  auto P = state.P();
  const int others = state.size() - kBodySize;
  const int e0 = extrinsics(0);
  const BodyMatrix P_bb = P.topLeftCorner<kBodySize, kBodySize>();
  MotionMatrix moved = motion.Phi * P_bb * motion.Phi.transpose() + motion.Q;

  // Body and step against everything that stands still (cameras) or is moved below (tags).
  if (body_tags_.cols() < others) body_tags_.resize(kMotionSize, P.cols() * 2);
  auto moved_others = body_tags_.leftCols(others);
  moved_others.noalias() = motion.Phi * P.block(0, kBodySize, kBodySize, others);
  P.topLeftCorner<kBodySize, kBodySize>() = moved.topLeftCorner<kBodySize, kBodySize>();
  P.block(0, kBodySize, kBodySize, others) = moved_others.topRows<kBodySize>();
  P.block(kBodySize, 0, others, kBodySize) = moved_others.topRows<kBodySize>().transpose();

  // z = (step, extrinsics of camera 0) and what it shares with the rest.
  Matrix12d S;
  S.topLeftCorner<6, 6>() = moved.bottomRightCorner<6, 6>();
  S.topRightCorner<6, 6>() = moved_others.block<6, 6>(kBodySize, e0 - kBodySize);
  S.bottomLeftCorner<6, 6>() = S.topRightCorner<6, 6>().transpose();
  S.bottomRightCorner<6, 6>() = P.block<6, 6>(e0, e0);

  const std::size_t n = state.tags.size();
  if (moves_.size() < n) moves_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    TagMove& move = moves_[i];
    move = move_tag(state.X_BV[0], motion.X_B0B, state.tags[i].X_VT);
    move.L << moved_others.middleCols<6>(state.tag_at(i) - kBodySize).bottomRows<6>(),
        P.block<6, 6>(e0, state.tag_at(i));
    move.V.noalias() = move.A * move.L.transpose();
    move.U.noalias() = move.L * move.A.transpose();
    move.U.noalias() += S * move.M.transpose();
  }
  // Body and cameras against tags: A on the tag's side, plus their share of z.
  for (int row = 0; row < state.tag_at(0); row += 3) {
    Eigen::Matrix<double, 3, 12> share;
    if (row < kBodySize) {
      share << moved.block<3, 6>(row, kStepPosition), P.block<3, 6>(row, e0);
    } else {
      share << moved_others.block<6, 3>(kBodySize, row - kBodySize).transpose(),
          P.block<3, 6>(row, e0);
    }
    for (std::size_t i = 0; i < n; ++i) {
      const int at = state.tag_at(i);
      const Matrix3x6d block =
          P.block<3, 6>(row, at) * moves_[i].A.transpose() + share * moves_[i].M.transpose();
      P.block<3, 6>(row, at) = block;
      P.block<6, 3>(at, row) = block.transpose();
    }
  }
  move_tag_blocks(state);
  motion.restart();
}

Eigen::VectorXd FrameTransition::spread(const FilterState& state,
                                        const Eigen::Matrix<double, kMotionSize, 1>& error) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(state.size());
  out.head<kBodySize>() = error.head<kBodySize>();
  for (std::size_t i = 0; i < state.tags.size(); ++i)
    out.segment<6>(state.tag_at(i)) = moves_[i].M.leftCols<6>() * error.tail<6>();
  return out;
}

void FrameTransition::move_tag_blocks(FilterState& state) {
  auto P = state.P();
  for (std::size_t j = 0; j < state.tags.size(); ++j) {
    const int col = state.tag_at(j);
    for (std::size_t i = 0; i <= j; ++i) {
      const int row = state.tag_at(i);
      Matrix6d half;
      half.noalias() = moves_[i].A * P.block<6, 6>(row, col);
      Matrix6d block;
      block.noalias() = half * moves_[j].A.transpose();
      block.noalias() += moves_[i].V * moves_[j].M.transpose();
      block.noalias() += moves_[i].M * moves_[j].U;
      P.block<6, 6>(row, col) = block;
      P.block<6, 6>(col, row) = block.transpose();
    }
  }
}

}  // namespace fiducap::robocentric
