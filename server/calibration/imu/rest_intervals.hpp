#pragma once

#include <span>
#include <vector>

#include "capture/imu_sample.hpp"

namespace fiducap {

/// Samples [begin, end) between which an IMU lay still.
struct RestInterval {
  std::size_t begin{};
  std::size_t end{};
};

/// How much the accelerometer scatters within a second around each sample: standard deviation, root
/// of the three axes' squares, m/s².
[[nodiscard]] std::vector<double> scatter_of_accel(std::span<const ImuSample> samples,
                                                   std::size_t samples_per_second);

/// Stretches of `least` samples and more in which the scatter stays below `limit`, a quarter of a
/// second cut off at both ends.
[[nodiscard]] std::vector<RestInterval> find_rests(std::span<const double> scatter, double limit,
                                                   std::size_t samples_per_second,
                                                   std::size_t least);

}  // namespace fiducap
