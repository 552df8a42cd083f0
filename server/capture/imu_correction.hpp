#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"

namespace fiducap {

struct ImuSample;

/// What is wrong with an inertial unit for good: zero, scale, axes that are not square to each
/// other, and a gyro that does not sit straight on the accelerometer. Corrected = matrix · (reading
/// − bias).
struct ImuCorrection {
  Eigen::Vector3d accel_bias_m_s2{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d accel_matrix{Eigen::Matrix3d::Identity()};
  Eigen::Vector3d gyro_bias_rad_s{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d gyro_matrix{Eigen::Matrix3d::Identity()};

  [[nodiscard]] ImuSample apply(ImuSample sample) const;
  /// @param prefix  where it stands, e.g. `bodies.0.imu_correction.`
  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// The section `imu_correction` of a file, or a file that is one; matrices row by row.
[[nodiscard]] Expected<ImuCorrection> read_imu_correction(const std::string& path);
/// The same as text, with a comment before it.
[[nodiscard]] std::string to_imu_correction_yaml(const ImuCorrection& correction,
                                                 const std::string& heading);

}  // namespace fiducap
