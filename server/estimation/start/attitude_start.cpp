#include "estimation/start/attitude_start.hpp"

#include <algorithm>

#include "base/so3.hpp"

namespace fiducap {

void AttitudeStart::add(const ImuSample& imu, const Eigen::Vector3d& bias_w,
                        const Eigen::Vector3d& bias_f) {
  double dt = 0;
  if (last_) {
    dt = to_seconds(imu.sampled_at - last_->sampled_at);
    q_LB_ = (q_LB_ * exp_so3((0.5 * (imu.w_WB_B + last_->w_WB_B) - bias_w) * dt)).normalized();
  }
  last_ = imu;
  ++samples_;
  // A plain mean at first, then a fading one.
  const double share = std::max(1.0 / samples_, dt / (kMemory_s + dt));
  f_L_ += share * (q_LB_ * (imu.f_B - bias_f) - f_L_);
}

Eigen::Quaterniond AttitudeStart::q_LB(Instant at, const Eigen::Vector3d& bias_w) const {
  if (!last_) return q_LB_;
  const double dt = to_seconds(at - last_->sampled_at);
  return q_LB_ * exp_so3((last_->w_WB_B - bias_w) * dt);
}

Eigen::Quaterniond AttitudeStart::q_WB(Instant at, const Eigen::Vector3d& bias_w) const {
  return Eigen::Quaterniond::FromTwoVectors(f_L_, Eigen::Vector3d::UnitZ()) * q_LB(at, bias_w);
}

}  // namespace fiducap
