#include "estimation/robocentric/relink.hpp"

#include "base/so3.hpp"
#include "estimation/filter/heading_rule.hpp"

namespace fiducap::robocentric {

std::vector<SightedTag> tags_at_start(const FilterState& state, int camera,
                                      const CameraModel& model, std::span<const TagToUse> tags) {
  std::vector<SightedTag> sighted;
  for (const TagToUse& tag : tags) {
    const Pose X_B0T = tag.local >= 0
                           ? state.X_BV[0] * state.tags[static_cast<std::size_t>(tag.local)].X_VT
                           : state.X_WB().inverse() * tag.known->X_WT;
    sighted.push_back({tag.seen, &model, state.X_BV[static_cast<std::size_t>(camera)], X_B0T});
  }
  return sighted;
}

MotionSinceImage step_by_unknown_motion(FilterState& state, const Pose& X_B0B, bool has_imu) {
  using namespace layout;  // NOLINT: the block names are the subject of this function
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

}  // namespace fiducap::robocentric
