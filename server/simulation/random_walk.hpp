#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "simulation/random.hpp"

namespace fiducap::simulation {

/// A three-dimensional Brownian motion on a grid of ticks: zero at tick 0, each step has variance 1
/// per axis.
///
/// Any tick can be asked for at any time with the same answer (Lévy's midpoint construction on
/// hashed keys), so truth of the past needs no memory. Walking forward costs two draws per tick, a
/// jump at most `kLevels`.
class RandomWalk final {
 public:
  RandomWalk(std::uint64_t seed, Purpose purpose);
  /// @pre tick <= 2^kLevels (at 1 kHz: 34 years)
  [[nodiscard]] Eigen::Vector3d at(std::uint64_t tick);

  static constexpr int kLevels = 40;

 private:
  struct Interval {
    std::uint64_t low{};
    std::uint64_t high{};
    Eigen::Vector3d at_low;
    Eigen::Vector3d at_high;
  };

  std::uint64_t seed_;
  Purpose purpose_;
  std::array<Interval, kLevels + 1> path_;  ///< Nested halves down to the last tick asked for.
  std::size_t depth_{0};
};

}  // namespace fiducap::simulation
