#include "simulation/random_walk.hpp"

#include "base/assert.hpp"

namespace fiducap::simulation {

RandomWalk::RandomWalk(std::uint64_t seed, Purpose purpose) : seed_(seed), purpose_(purpose) {
  constexpr std::uint64_t kEnd = std::uint64_t{1} << kLevels;
  const double sigma = std::sqrt(static_cast<double>(kEnd));
  path_[0] = {0, kEnd, Eigen::Vector3d::Zero(), sigma * Random(seed, purpose, kEnd).normal3()};
}

Eigen::Vector3d RandomWalk::at(std::uint64_t tick) {
  FIDUCAP_ASSERT(tick <= path_[0].high);
  while (depth_ > 0 && (tick < path_[depth_].low || tick > path_[depth_].high)) --depth_;
  for (;;) {
    const Interval& whole = path_[depth_];
    if (tick == whole.low) return whole.at_low;
    if (tick == whole.high) return whole.at_high;
    // Between two known points the middle is normal about their mean, variance length / 4. Its tick
    // is a unique key.
    const std::uint64_t middle = (whole.low + whole.high) / 2;
    const double sigma = 0.5 * std::sqrt(static_cast<double>(whole.high - whole.low));
    const Eigen::Vector3d at_middle =
        0.5 * (whole.at_low + whole.at_high) + sigma * Random(seed_, purpose_, middle).normal3();
    path_[depth_ + 1] = tick < middle ? Interval{whole.low, middle, whole.at_low, at_middle}
                                      : Interval{middle, whole.high, at_middle, whole.at_high};
    ++depth_;
  }
}

}  // namespace fiducap::simulation
