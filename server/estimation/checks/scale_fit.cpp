#include "estimation/checks/scale_fit.hpp"

#include "base/pose.hpp"

namespace fiducap {

namespace {
// Sigma of a median relative to that of a mean, white noise.
constexpr double kMedianLoss = 1.2533;
constexpr double kSameSide = 0.02;
// Bound of one estimate's deviation, in sigmas.
constexpr double kHuber = 3.0;
constexpr double kLongestGap_s = 0.03;
// Factor of the sensor's noise above which ImuBuffer bridges a gap or saturation.
constexpr double kBridging = 2.0;
constexpr double kGapAccel_m_s2_rtHz = 3.0;
}  // namespace

void ScaleScore::add(const LogScale& look) {
  looks_[next_] = look;
  next_ = (next_ + 1) % kMost;
  count_ = std::min(count_ + 1, kMost);
}

std::optional<LogScale> ScaleScore::guess() const {
  if (count_ == 0) return std::nullopt;
  std::array<LogScale, kMost> sorted = looks_;
  const auto end = sorted.begin() + static_cast<std::ptrdiff_t>(count_);
  std::sort(sorted.begin(), end,
            [](const LogScale& a, const LogScale& b) { return a.value < b.value; });
  double total = 0;
  for (auto look = sorted.begin(); look != end; ++look) total += weight_of(*look);
  auto middle = sorted.begin();
  for (double sum = weight_of(*middle); sum < total / 2; sum += weight_of(*middle)) ++middle;
  double scatter = 0;
  for (auto look = sorted.begin(); look != end; ++look) {
    const double off =
        std::min(kHuber * kHuber,
                 (look->value - middle->value) * (look->value - middle->value) * weight_of(*look));
    scatter += off / static_cast<double>(std::max<std::size_t>(1, count_ - 1));
  }
  return LogScale{middle->value, kMedianLoss * std::sqrt(std::max(1.0, scatter) / total)};
}

double ScaleScore::agreement(double value) const {
  double total = 0;
  double same = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    total += weight_of(looks_[i]);
    if (value > 0 ? looks_[i].value > kSameSide : looks_[i].value < -kSameSide)
      same += weight_of(looks_[i]);
  }
  return total > 0 ? same / total : 0.0;
}

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
  while (time_ < at) {
    const Instant to = imu_.end_of_interval(time_, at);
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
  imu_.forget_before(at);
  return believable_;
}

}  // namespace fiducap
