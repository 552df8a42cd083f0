#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "capture/imu_sample.hpp"

namespace fiducap {

/// A reading of one of the sensors that make an IMU.
struct VectorReading {
  std::int64_t ns{};
  Eigen::Vector3d v{Eigen::Vector3d::Zero()};
};

/// What became of two streams.
struct ImuPairs {
  std::vector<ImuSample> samples;
  std::size_t alone{0};  ///< Gyro readings without an accelerometer around them: left out.
};

/// Sorts by time and strikes what comes twice: phones write so.
/// @return how many were struck
std::size_t put_in_order(std::vector<VectorReading>& readings);

/// The accelerometer at the times of the gyro, linear between the readings around each.
/// @pre both in order   @param longest_gap  over which nothing is interpolated
[[nodiscard]] ImuPairs pair_readings(const std::vector<VectorReading>& gyro,
                                     const std::vector<VectorReading>& accel, Duration longest_gap);

}  // namespace fiducap
