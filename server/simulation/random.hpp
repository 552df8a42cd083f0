#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include <Eigen/Core>

namespace fiducap::simulation {

/// Use of random numbers. Each has separate streams: switching one off changes no other.
enum class Purpose : std::uint64_t {
  kRoom = 1,
  kMotion,
  kImuErrors,
  kImuNoise,
  kGyroWalk,
  kAccelWalk,
  kCornerNoise,
  kPixelNoise,
  kBackdrop,
  kImuFaults,
  kImageFaults,
  kTagFaults,
  kCornerFaults,
  kStampFaults
};

/// Random numbers that depend only on their key: equal on all machines and in any order of streams.
///
/// Generator: SplitMix64 (Steele, Lea, Flood, OOPSLA 2014). Small state: a stream per sample.
class Random final {
 public:
  Random(std::uint64_t seed, Purpose purpose, std::uint64_t a = 0, std::uint64_t b = 0)
      : state_(mixed(mixed(mixed(mixed(seed) ^ static_cast<std::uint64_t>(purpose)) ^ a) ^ b)) {}

  std::uint64_t bits() { return mixed(state_ += kStep); }
  /// In [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform in a box. (Draws in sequence: the order of evaluation of arguments is unspecified.)
  Eigen::Vector3d inside(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
    const double x = uniform(low.x(), high.x());
    const double y = uniform(low.y(), high.y());
    return {x, y, uniform(low.z(), high.z())};
  }
  /// In [0, n), n > 0.
  int below(int n) { return static_cast<int>(bits() % static_cast<std::uint64_t>(n)); }
  bool chance(double probability) { return uniform() < probability; }
  /// Mean 0, variance 1 (Box–Muller; std::normal_distribution differs between libraries).
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    const double angle = 2.0 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }
  Eigen::Vector3d normal3() {
    const double x = normal();
    const double y = normal();
    return {x, y, normal()};
  }

 private:
  static constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15;
  static std::uint64_t mixed(std::uint64_t z) {
    z += kStep;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }

  std::uint64_t state_;
  double spare_{0};
  bool has_spare_{false};
};

}  // namespace fiducap::simulation
