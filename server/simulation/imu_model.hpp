#pragma once

#include <cstdint>

#include "capture/imu_sample.hpp"
#include "simulation/random_walk.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

/// The true biases at an instant.
struct ImuBias {
  Eigen::Vector3d w;
  Eigen::Vector3d f;
};

/// An inertial unit: point samples of rate and specific force through scale, misalignment, bias
/// walk, white noise and saturation. Sample k depends on nothing but the seed and k.
class ImuModel final {
 public:
  ImuModel(const ImuErrors& errors, double gravity_m_s2, std::uint64_t seed);
  /// @param truth  at t = k / rate  @return everything but the stamp
  [[nodiscard]] ImuSample measure(std::uint64_t k, const Trajectory::Point& truth);
  /// At any time, linear between samples. Thread-safe.
  [[nodiscard]] ImuBias bias_at(double t_s) const;

 private:
  ImuErrors errors_;
  double gravity_m_s2_;
  std::uint64_t seed_;
  Eigen::Matrix3d gyro_gain_;  ///< Scale and misalignment.
  Eigen::Matrix3d accel_gain_;
  RandomWalk gyro_walk_;
  RandomWalk accel_walk_;
};

/// Specific force of a point of the body's origin: what an accelerometer without errors reads.
[[nodiscard]] inline Eigen::Vector3d specific_force(const Trajectory::Point& truth,
                                                    double gravity_m_s2) {
  return truth.X_WB.q.conjugate() * (truth.a_WB + Eigen::Vector3d(0, 0, gravity_m_s2));
}

}  // namespace fiducap::simulation
