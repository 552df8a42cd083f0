#pragma once

#include <algorithm>

#include <Eigen/Core>

namespace fiducap::loop {

struct Gains {
  double position_1_s;
  double velocity_1_s;
  double integral_1_s2;
  double max_speed_m_s{1.0};
  double max_integral_m_s2{2.0};
};
/// What a feedback with a late velocity still bears, and what a prompt one allows.
inline constexpr Gains kSoft{2.0, 5.0, 3.0};
inline constexpr Gains kStiff{2.5, 9.0, 9.0};

/// The controller of the paper's closed loop: an outer position loop asks for a velocity, an inner
/// velocity loop with an integrator asks for an acceleration.
class Cascade final {
 public:
  Cascade(const Gains& gains, const Eigen::Vector3d& target) : gains_(gains), target_(target) {}

  /// @return the acceleration to ask for, m/s²
  [[nodiscard]] Eigen::Vector3d update(const Eigen::Vector3d& p, const Eigen::Vector3d& v,
                                       double dt) {
    Eigen::Vector3d v_wanted = gains_.position_1_s * (target_ - p);
    if (v_wanted.norm() > gains_.max_speed_m_s) v_wanted *= gains_.max_speed_m_s / v_wanted.norm();
    const Eigen::Vector3d error = v_wanted - v;
    integral_ += gains_.integral_1_s2 * dt * error;
    integral_ = integral_.cwiseMax(-gains_.max_integral_m_s2).cwiseMin(gains_.max_integral_m_s2);
    return gains_.velocity_1_s * error + integral_;
  }

 private:
  Gains gains_;
  Eigen::Vector3d target_;
  Eigen::Vector3d integral_{Eigen::Vector3d::Zero()};
};

}  // namespace fiducap::loop
