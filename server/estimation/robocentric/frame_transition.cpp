#include "estimation/robocentric/frame_transition.hpp"

#include "base/so3.hpp"

namespace fiducap::robocentric {

using namespace layout;  // NOLINT: the block names are the subject of this file

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

  Matrix6d to_camera = Matrix6d::Zero();
  to_camera.topLeftCorner<3, 3>() = R_BV.transpose();
  to_camera.bottomRightCorner<3, 3>() = R_BV.transpose();

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
  for (std::size_t i = 0; i < state.tags.size(); ++i) {
    out.segment<6>(state.tag_at(i)) = moves_[i].M.leftCols<6>() * error.tail<6>();
  }
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
