#include "simulation/imu_model.hpp"

#include <cmath>

namespace fiducap::simulation {

namespace {

/// Each axis has a scale of its own and points a little beside where it should.
Eigen::Matrix3d gain(Random& random, const ImuErrors& errors) {
  Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      m(row, column) +=
          random.normal() * (row == column ? errors.scale_error : errors.misalignment_rad);
    }
  }
  return m;
}

Eigen::Vector3d clamped(const Eigen::Vector3d& x, double range) {
  return x.cwiseMax(-range).cwiseMin(range);
}

}  // namespace

ImuModel::ImuModel(const ImuErrors& errors, double gravity_m_s2, std::uint64_t seed)
    : errors_(errors),
      gravity_m_s2_(gravity_m_s2),
      seed_(seed),
      gyro_walk_(seed, Purpose::kGyroWalk),
      accel_walk_(seed, Purpose::kAccelWalk) {
  Random random(seed, Purpose::kImuErrors);
  gyro_gain_ = gain(random, errors);
  accel_gain_ = gain(random, errors);
}

ImuSample ImuModel::measure(std::uint64_t k, const Trajectory::Point& truth) {
  // Densities per √Hz: white noise of one sample is density · √rate, one step of the walk is
  // density / √rate.
  const double root_rate = std::sqrt(errors_.noise.rate_hz);
  const Eigen::Vector3d bias_w =
      errors_.gyro_bias + errors_.noise.gyro_walk_rad_s2_rtHz / root_rate * gyro_walk_.at(k);
  const Eigen::Vector3d bias_f =
      errors_.accel_bias + errors_.noise.accel_walk_m_s3_rtHz / root_rate * accel_walk_.at(k);
  Random random(seed_, Purpose::kImuNoise, k);
  const Eigen::Vector3d noise_w =
      errors_.noise.gyro_noise_rad_s_rtHz * root_rate * random.normal3();
  const Eigen::Vector3d noise_f =
      errors_.noise.accel_noise_m_s2_rtHz * root_rate * random.normal3();
  ImuSample sample;
  sample.w_WB_B = clamped(gyro_gain_ * truth.w_WB_B + bias_w + noise_w, errors_.gyro_range_rad_s);
  sample.f_B = clamped(accel_gain_ * specific_force(truth, gravity_m_s2_) + bias_f + noise_f,
                       errors_.accel_range_m_s2);
  return sample;
}

ImuBias ImuModel::bias_at(double t_s) const {
  const double ticks = std::max(0.0, t_s * errors_.noise.rate_hz);
  const auto k = static_cast<std::uint64_t>(ticks);
  const double share = ticks - static_cast<double>(k);
  const double root_rate = std::sqrt(errors_.noise.rate_hz);
  RandomWalk gyro_walk(seed_,
                       Purpose::kGyroWalk);  // copies of their own: the walks of `measure` move
  RandomWalk accel_walk(seed_, Purpose::kAccelWalk);
  const auto between = [&](RandomWalk& walk) -> Eigen::Vector3d {
    const Eigen::Vector3d before = walk.at(k);
    return before + share * (walk.at(k + 1) - before);
  };
  return {
      errors_.gyro_bias + errors_.noise.gyro_walk_rad_s2_rtHz / root_rate * between(gyro_walk),
      errors_.accel_bias + errors_.noise.accel_walk_m_s3_rtHz / root_rate * between(accel_walk)};
}

}  // namespace fiducap::simulation
