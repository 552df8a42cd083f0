#pragma once

#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "capture/imu_sample.hpp"

namespace fiducap {

/// How the body turns while there is no pose: gyro for the turning, the accelerometer's slow part
/// for up.
///
/// Tilt is right to a few degrees when the body does not accelerate for long; heading is arbitrary
/// and drifts.
class AttitudeStart final {
 public:
  void add(const ImuSample& imu, const Eigen::Vector3d& bias_w, const Eigen::Vector3d& bias_f);
  void restart() { *this = AttitudeStart{}; }
  /// Enough samples to know up.
  [[nodiscard]] bool ready() const { return samples_ >= kNeededSamples; }
  /// Body in axes L that stand still (start of the turning), for comparing views. Beyond the newest
  /// sample its rate holds.
  [[nodiscard]] Eigen::Quaterniond q_LB(Instant at, const Eigen::Vector3d& bias_w) const;
  /// Body in level axes, heading as in L.
  [[nodiscard]] Eigen::Quaterniond q_WB(Instant at, const Eigen::Vector3d& bias_w) const;

 private:
  static constexpr int kNeededSamples = 10;
  static constexpr double kMemory_s = 0.5;  ///< Time constant of the slow part of the force.

  Eigen::Quaterniond q_LB_{Eigen::Quaterniond::Identity()};
  Eigen::Vector3d f_L_{Eigen::Vector3d::Zero()};
  std::optional<ImuSample> last_;
  int samples_{0};
};

}  // namespace fiducap
