#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/time.hpp"
#include "estimation/imu/imu_buffer.hpp"

namespace fiducap {

/// How a body moved by its IMU alone since some moment, up to what a constant velocity, a constant
/// force and a constant bias explain. Nothing that a camera says about places is in it.
class MotionWindow final {
 public:
  explicit MotionWindow(const ImuNoise& noise);

  /// @return false: not newer than the one before, left out
  bool push(const ImuSample& imu) { return imu_.push(imu); }
  /// @param q_WB  attitude now; how level it is does not matter, a constant force is left open
  /// @param gravity_W  e.g. (0, 0, -9.81)
  void restart(Instant at, const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& bias_w,
               const Eigen::Vector3d& gravity_W);
  /// @return false when the readings on the way are not to be believed (hole, end of range) or
  /// missing
  bool move_to(Instant at);

  /// No look is going on: old readings are not needed.
  void keep_newest() { imu_.keep_newest_pair(); }

  [[nodiscard]] double seconds() const { return to_seconds(time_ - begin_); }
  [[nodiscard]] const Eigen::Quaterniond& q_WB() const { return q_WB_; }
  [[nodiscard]] const Eigen::Vector3d& way() const { return way_; }  ///< m, W axes; started at rest
  [[nodiscard]] const Eigen::Vector3d& speed() const {
    return speed_;
  }  ///< m/s, W axes; started at 0
  [[nodiscard]] const Eigen::Vector3d& rate_B() const { return rate_B_; }
  /// ∂ way / ∂ constant force in B axes
  [[nodiscard]] const Eigen::Matrix3d& way_by_bias() const { return way_by_bias_; }

 private:
  void step_to(Instant to);

  ImuNoise noise_;
  ImuBuffer imu_;
  Instant begin_{};
  Instant time_{};
  Eigen::Quaterniond q_WB_{Eigen::Quaterniond::Identity()};
  Eigen::Vector3d bias_w_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gravity_W_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d way_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d speed_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d rate_B_{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d way_by_bias_{Eigen::Matrix3d::Zero()};
  Eigen::Matrix3d speed_by_bias_{Eigen::Matrix3d::Zero()};
  bool believable_{true};
};

}  // namespace fiducap
