#include "closed_loop/plant.hpp"

#include <algorithm>
#include <cmath>

namespace fiducap::loop {

namespace {

constexpr double kGravity_m_s2 = 9.81;
constexpr double kYaw_rad = M_PI / 2;  // looks at the wall y = +4 m

/// Rz(yaw) Ry(pitch) Rx(roll) and the rate that belongs to its derivatives, body axes.
struct Attitude {
  double roll{}, pitch{}, roll_rate{}, pitch_rate{};

  [[nodiscard]] Eigen::Quaterniond q_WB() const {
    return Eigen::AngleAxisd(kYaw_rad, Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
           Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
  }
  [[nodiscard]] Eigen::Vector3d w_WB_B() const {
    return {roll_rate, pitch_rate * std::cos(roll), -pitch_rate * std::sin(roll)};
  }
};

Plant::Point at_rest(double height_m) {
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  return {{Attitude{}.q_WB(), {0, 0, height_m}}, zero, zero, zero};
}

/// Value and two derivatives of amplitude · sin(2π f t + phase).
struct Swing {
  double value, rate, acceleration;
  Swing(double amplitude, double f_Hz, double phase, double t_s) {
    const double w = 2 * M_PI * f_Hz;
    value = amplitude * std::sin(w * t_s + phase);
    rate = amplitude * w * std::cos(w * t_s + phase);
    acceleration = -w * w * value;
  }
};

class Walker final : public Plant {
 public:
  explicit Walker(std::uint64_t seed) : pushes_(0.3, 0.5, seed) {}

 private:
  static constexpr double kHeight_m = 0.9;

  [[nodiscard]] Point held() const override { return at_rest(kHeight_m); }

  Point step(double t_s, const Eigen::Vector3d& command) override {
    constexpr double kLegs_s = 0.08;
    constexpr double kMostLegs_m_s2 = 3.0;
    constexpr double kWaking_s = 2.0;
    const double after_s = t_s + kStep_s;
    Eigen::Vector3d wanted = command;
    wanted.z() = 0;
    if (wanted.norm() > kMostLegs_m_s2) wanted *= kMostLegs_m_s2 / wanted.norm();
    legs_ += (wanted - legs_) * kStep_s / kLegs_s;
    // The belt changes the robot's speed over ground: slow swings and sometimes a jolt, along its
    // heading.
    const double belt =
        0.6 * std::sin(2 * M_PI * t_s / 7) + 1.5 * std::pow(std::sin(2 * M_PI * t_s / 11), 21);
    const Eigen::Vector3d push = pushes_.next(kStep_s);
    const Eigen::Vector3d a = legs_ + Eigen::Vector3d(push.x(), push.y() - belt, 0);
    v_ += a * kStep_s;
    p_ += v_ * kStep_s - 0.5 * kStep_s * kStep_s * a;
    const double waking = std::min(after_s / kWaking_s, 1.0);  // the gait begins softly
    const Swing bob(0.015 * waking, 3.0, 0, after_s);
    const Swing roll(0.03 * waking, 1.5, 0, after_s);
    const Swing pitch(0.02 * waking, 3.0, 0, after_s);
    const Attitude attitude{roll.value, pitch.value, roll.rate, pitch.rate};
    return {{attitude.q_WB(), p_ + Eigen::Vector3d(0, 0, kHeight_m + bob.value)},
            v_ + Eigen::Vector3d(0, 0, bob.rate),
            a + Eigen::Vector3d(0, 0, bob.acceleration),
            attitude.w_WB_B()};
  }

  Gusts pushes_;
  Eigen::Vector3d legs_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d p_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d v_{Eigen::Vector3d::Zero()};
};

class Quadrotor final : public Plant {
 public:
  explicit Quadrotor(std::uint64_t seed) : gusts_(0.4, 1.0, seed) {}

 private:
  [[nodiscard]] Point held() const override { return at_rest(1.4); }

  Point step(double, const Eigen::Vector3d& command) override {
    constexpr double kTilt_rad_s = 12.0;
    constexpr double kDamping = 0.8;
    constexpr double kThrust_s = 0.05;
    constexpr double kMostTilt_rad = 0.4;
    const Eigen::Vector3d force = command + Eigen::Vector3d(0, 0, kGravity_m_s2);
    // In axes turned by the yaw: x forward, y left.
    const double forward = std::cos(kYaw_rad) * force.x() + std::sin(kYaw_rad) * force.y();
    const double left = -std::sin(kYaw_rad) * force.x() + std::cos(kYaw_rad) * force.y();
    const double pitch = std::clamp(std::atan2(forward, force.z()), -kMostTilt_rad, kMostTilt_rad);
    const double roll = std::clamp(std::atan2(-left, force.z()), -kMostTilt_rad, kMostTilt_rad);
    follow(attitude_.roll, attitude_.roll_rate, roll, kTilt_rad_s, kDamping);
    follow(attitude_.pitch, attitude_.pitch_rate, pitch, kTilt_rad_s, kDamping);
    thrust_ += (std::clamp(force.norm(), 0.0, 2 * kGravity_m_s2) - thrust_) * kStep_s / kThrust_s;
    const Eigen::Vector3d a = attitude_.q_WB() * Eigen::Vector3d(0, 0, thrust_) -
                              Eigen::Vector3d(0, 0, kGravity_m_s2) + gusts_.next(kStep_s);
    v_ += a * kStep_s;
    p_ += v_ * kStep_s - 0.5 * kStep_s * kStep_s * a;
    return {{attitude_.q_WB(), p_}, v_, a, attitude_.w_WB_B()};
  }

  static void follow(double& angle, double& rate, double wanted, double w, double damping) {
    rate += (w * w * (wanted - angle) - 2 * damping * w * rate) * kStep_s;
    angle += rate * kStep_s;
  }

  Gusts gusts_;
  Attitude attitude_;
  double thrust_{kGravity_m_s2};
  Eigen::Vector3d p_{0, 0, 1.4};
  Eigen::Vector3d v_{Eigen::Vector3d::Zero()};
};

}  // namespace

simulation::Trajectory::Point Plant::at(double t_s) const {
  const std::lock_guard lock(mutex_);
  auto& self = const_cast<Plant&>(*this);  // a query advances the time
  if (past_.empty()) past_.push_back(held());
  const double place = std::max(t_s, 0.0) / kStep_s;
  while (static_cast<double>(steps_) < place) {
    past_.push_back(command_ ? self.step(static_cast<double>(free_steps_++) * kStep_s, *command_)
                             : held());
    ++steps_;
    if (past_.size() > kMemory) past_.pop_front();
  }
  // Linear between two steps; the position by the velocity.
  const double back = static_cast<double>(steps_) - place;
  const auto last = static_cast<double>(past_.size() - 1);
  const double where = std::clamp(last - back, 0.0, last);
  const auto i = static_cast<std::size_t>(where);
  const Point& before = past_[i];
  if (i + 1 == past_.size()) return before;
  const Point& after = past_[i + 1];
  const double s = where - static_cast<double>(i);
  Point out = before;
  out.X_WB.p += s * kStep_s * (before.v_WB + 0.5 * s * (after.v_WB - before.v_WB));
  out.X_WB.q = before.X_WB.q.slerp(s, after.X_WB.q);
  out.v_WB += s * (after.v_WB - before.v_WB);
  out.a_WB += s * (after.a_WB - before.a_WB);
  out.w_WB_B += s * (after.w_WB_B - before.w_WB_B);
  return out;
}

double Plant::free_for() const {
  const std::lock_guard lock(mutex_);
  return static_cast<double>(free_steps_) * kStep_s;
}

void Plant::command(const Eigen::Vector3d& a_W) {
  const std::lock_guard lock(mutex_);
  command_ = a_W;
}

const Eigen::Vector3d& Gusts::next(double dt) {
  std::normal_distribution<double> normal;
  const double scale = sigma_ * std::sqrt(2 * dt / memory_s_);
  for (int i = 0; i < 3; ++i) value_(i) += -value_(i) * dt / memory_s_ + scale * normal(random_);
  return value_;
}

std::unique_ptr<Plant> make_walker(std::uint64_t seed) { return std::make_unique<Walker>(seed); }
std::unique_ptr<Plant> make_quadrotor(std::uint64_t seed) {
  return std::make_unique<Quadrotor>(seed);
}

}  // namespace fiducap::loop
