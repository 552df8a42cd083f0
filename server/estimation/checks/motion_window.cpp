#include "estimation/checks/motion_window.hpp"

#include "base/so3.hpp"

namespace fiducap {

namespace {
constexpr double kLongestGap_s = 0.03;
// Noise that ImuBuffer reports instead of the sensor's when it bridges something.
constexpr double kBridging = 2.0;
constexpr double kGapAccel_m_s2_rtHz = 3.0;
}  // namespace

MotionWindow::MotionWindow(const ImuNoise& noise)
    : noise_(noise), imu_(noise, kLongestGap_s, kGapAccel_m_s2_rtHz) {}

void MotionWindow::restart(Instant at, const Eigen::Quaterniond& q_WB,
                           const Eigen::Vector3d& bias_w, const Eigen::Vector3d& gravity_W) {
  begin_ = time_ = at;
  q_WB_ = q_WB;
  bias_w_ = bias_w;
  gravity_W_ = gravity_W;
  way_.setZero();
  speed_.setZero();
  way_by_bias_.setZero();
  speed_by_bias_.setZero();
  believable_ = true;
  imu_.forget_before(at);
}

bool MotionWindow::move_to(Instant at) {
  if (!imu_.newest()) return false;
  while (time_ < at) step_to(imu_.end_of_interval(time_, at));
  imu_.forget_before(at);
  return believable_;
}

void MotionWindow::step_to(Instant to) {
  const InertialInput input = imu_.input_between(time_, to);
  const double dt = to_seconds(to - time_);
  const bool bridged = !input.has_accelerometer ||
                       input.gyro_noise > kBridging * noise_.gyro_noise_rad_s_rtHz ||
                       input.accel_noise > kBridging * noise_.accel_noise_m_s2_rtHz;
  if (bridged) believable_ = false;
  rate_B_ = input.w_B - bias_w_;
  const Eigen::Matrix3d R_WB = (q_WB_ * exp_so3(rate_B_ * (0.5 * dt))).toRotationMatrix();
  const Eigen::Vector3d a_WB = R_WB * input.f_B + gravity_W_;
  way_ += speed_ * dt + a_WB * (0.5 * dt * dt);
  speed_ += a_WB * dt;
  way_by_bias_ += speed_by_bias_ * dt + R_WB * (0.5 * dt * dt);
  speed_by_bias_ += R_WB * dt;
  q_WB_ = (q_WB_ * exp_so3(rate_B_ * dt)).normalized();
  time_ = to;
}

}  // namespace fiducap
