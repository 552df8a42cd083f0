#include "estimation/robocentric/robocentric_filter.hpp"

#include "base/pose.hpp"
#include "estimation/filter/filter_rules.hpp"
#include "estimation/update/admission_impl.hpp"
#include "estimation/update/body_follower_impl.hpp"
#include "estimation/update/relocalisation_impl.hpp"
#include "estimation/update/tag_filter_impl.hpp"

namespace fiducap::robocentric {

using namespace layout;        // NOLINT: block names
using namespace filter_rules;  // NOLINT: short names

RobocentricCoordinates::RobocentricCoordinates(const BodySensors& sensors,
                                               const EstimatorConfig& config)
    : sensors_(sensors),
      config_(config),
      gravity_W_(0, 0, -sensors.gravity_m_s2),
      corner_noise_(config, false, nullptr) {}

void RobocentricCoordinates::reset(const ClockHypothesis&) {
  state_ = FilterState{};
  for (const CameraMount& mount : sensors_.cameras) state_.X_BV.push_back(mount.X_BV);
  state_.resize_covariance();
  auto P = state_.P();
  for (int c = 0; config_.estimate_extrinsics && c < state_.cameras(); ++c) {
    const CameraMount& mount = sensors_.cameras[static_cast<std::size_t>(c)];
    P.diagonal()
        .segment<3>(layout::extrinsics(c))
        .setConstant(mount.position_sigma_m * mount.position_sigma_m);
    P.diagonal()
        .segment<3>(layout::extrinsics(c) + 3)
        .setConstant(mount.rotation_sigma_rad * mount.rotation_sigma_rad);
  }
  motion_.restart();
}

void RobocentricCoordinates::start(Instant at, const std::optional<Eigen::Quaterniond>& q_WB) {
  auto P = state_.P();
  P.topRows<kBodySize>().setZero();
  P.leftCols<kBodySize>().setZero();
  state_.time = at;
  state_.p_WB_B.setZero();
  state_.v_WB_B.setZero();
  P.diagonal().segment<3>(kVelocity).setConstant(kStartVelocity_m_s * kStartVelocity_m_s);
  if (q_WB) {
    state_.q_WB = *q_WB;
    const Eigen::Vector3d up_B = state_.q_WB.conjugate() * Eigen::Vector3d::UnitZ();
    P.block<3, 3>(kAttitude, kAttitude) =
        kStartTilt_rad * kStartTilt_rad * (Eigen::Matrix3d::Identity() - up_B * up_B.transpose());
    P.diagonal().segment<3>(kBiasF).setConstant(kStartBiasF_m_s2 * kStartBiasF_m_s2);
    P.diagonal().segment<3>(kBiasW).setConstant(kStartBiasW_rad_s * kStartBiasW_rad_s);
  } else {
    state_.q_WB.setIdentity();
    P.diagonal().segment<3>(kBiasW).setConstant(kStartRate_rad_s * kStartRate_rad_s);
  }
  motion_.restart();
}

void RobocentricCoordinates::jump(const Pose& X_AB, Instant at) {
  motion_ = step_by_unknown_motion(state_, X_AB, sensors_.imu.has_value());
  transition_.apply(state_, motion_);
  state_.time = at;
}

void RobocentricCoordinates::aim(const Pose& X_B0B, double dt) {
  before_ = state_;
  aimed_off_.setZero();
  const Eigen::Vector3d v_before = state_.v_WB_B;
  const Eigen::Vector3d bias_before = state_.bias_w;
  state_.v_WB_B = X_B0B.p / dt;
  state_.bias_w = -log_so3(X_B0B.q) / dt;
  aimed_off_.segment<3>(kVelocity) = v_before - state_.v_WB_B;
  aimed_off_.segment<3>(kBiasW) = bias_before - state_.bias_w;
}

void RobocentricCoordinates::finish_aimed_motion() {
  const Eigen::Matrix<double, kMotionSize, 1> moved = motion_.Phi * aimed_off_;
  transition_.apply(state_, motion_);
  linearisation_ = state_;
  state_.add_error(transition_.spread(state_, moved));
}

UpdateReport RobocentricCoordinates::correct(const TagObservations& seen,
                                             std::span<const TagToUse> tags, double gate,
                                             int iterations, std::vector<bool>& accepted) {
  return corner_update_.apply(state_, seen.camera, model_of(seen.camera), tags,
                              {gate, iterations, linearisation_ ? &*linearisation_ : nullptr},
                              corner_noise_, accepted);
}

}  // namespace fiducap::robocentric

namespace fiducap {
template class TagFilter<robocentric::RobocentricCoordinates>;
}
