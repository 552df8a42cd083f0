#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <random>

#include "simulation/simulation.hpp"

namespace fiducap::loop {

/// A simulated body that follows commands.
///
/// `at` integrates up to its argument with the newest command, in steps of 1 ms, and keeps four
/// seconds. The robot is held still until its first command. Thread-safe.
class Plant : public simulation::Trajectory {
 public:
  [[nodiscard]] Point at(double t_s) const final;
  /// Since the first command, s.
  [[nodiscard]] double free_for() const;
  /// Acceleration command, W axes, m/s².
  void command(const Eigen::Vector3d& a_W);

 protected:
  static constexpr double kStep_s = 0.001;
  /// The initial state.
  [[nodiscard]] virtual Point held() const = 0;
  /// One step of kStep_s, `t_s` after its release. @return the state after it
  virtual Point step(double t_s, const Eigen::Vector3d& command) = 0;

 private:
  static constexpr std::size_t kMemory = 4000;

  mutable std::mutex mutex_;
  mutable std::deque<Point> past_;  ///< One per step; the last belongs to steps_ · kStep_s.
  mutable long long steps_{0};
  mutable long long free_steps_{0};
  std::optional<Eigen::Vector3d> command_;
};

/// Drifting noise with a memory (Ornstein–Uhlenbeck): gusts, pushes.
class Gusts final {
 public:
  Gusts(double sigma, double memory_s, std::uint64_t seed)
      : sigma_(sigma), memory_s_(memory_s), random_(seed) {}
  [[nodiscard]] const Eigen::Vector3d& next(double dt);

 private:
  double sigma_;
  double memory_s_;
  std::mt19937_64 random_;
  Eigen::Vector3d value_{Eigen::Vector3d::Zero()};
};

/// Walks on a treadmill with a belt of varying speed: the legs give accelerations with a lag of 80
/// ms, the gait shakes the body in height, roll and pitch, and it is pushed. Height is not
/// controlled.
[[nodiscard]] std::unique_ptr<Plant> make_walker(std::uint64_t seed);
/// A quadrotor in gusts: tilt follows with 12 rad/s, thrust with 50 ms.
[[nodiscard]] std::unique_ptr<Plant> make_quadrotor(std::uint64_t seed);

}  // namespace fiducap::loop
