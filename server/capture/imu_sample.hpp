#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"

namespace fiducap {

/// One reading of an IMU, in body axes B (= IMU axes), SI units, biases included.
struct ImuSample {
  Instant sampled_at{};
  Eigen::Vector3d w_WB_B{Eigen::Vector3d::Zero()};  ///< Angular rate of B against W, rad/s.
  /// Specific force, m/s²; at rest it points up with +9.81.
  Eigen::Vector3d f_B{Eigen::Vector3d::Zero()};
};

/// Samples in order; keeps its memory.
class ImuQueue final {
 public:
  void push(const ImuSample& sample) { samples_.push_back(sample); }
  /// The oldest one that was not taken yet.
  [[nodiscard]] std::optional<ImuSample> take() {
    if (taken_ < samples_.size()) return samples_[taken_++];
    samples_.clear();
    taken_ = 0;
    return std::nullopt;
  }

 private:
  std::vector<ImuSample> samples_;
  std::size_t taken_{0};
};

/// Constant errors of an IMU: bias, scale, misalignment. Corrected = matrix · (reading − bias).
struct ImuCorrection {
  Eigen::Vector3d accel_bias_m_s2{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d accel_matrix{Eigen::Matrix3d::Identity()};
  Eigen::Vector3d gyro_bias_rad_s{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d gyro_matrix{Eigen::Matrix3d::Identity()};

  [[nodiscard]] ImuSample apply(ImuSample sample) const;
  /// @param prefix  path in the configuration, e.g. `bodies.0.imu_correction.`
  [[nodiscard]] std::vector<ConfigError> check(const std::string& prefix) const;
};

/// The section `imu_correction` of a file, or a file that is one; matrices row by row.
[[nodiscard]] Expected<ImuCorrection> read_imu_correction(const std::string& path);
/// The same as text, after a comment.
[[nodiscard]] std::string to_imu_correction_yaml(const ImuCorrection& correction,
                                                 const std::string& heading);

/// Noise of an IMU: continuous-time densities, 1-sigma, as Kalibr and EuRoC define them.
struct ImuNoise {
  double gyro_noise_rad_s_rtHz{2e-3};  ///< White noise of the gyroscope.
  double gyro_walk_rad_s2_rtHz{2e-5};  ///< Random walk of the gyroscope's bias.
  double accel_noise_m_s2_rtHz{2e-2};  ///< White noise of the accelerometer.
  double accel_walk_m_s3_rtHz{5e-4};   ///< Random walk of the accelerometer's bias.
  double rate_hz{200.0};               ///< Samples per second.
  double gyro_range_rad_s{0};          ///< Readings saturate here; 0: not known.
  double accel_range_m_s2{0};          ///< The same for the accelerometer.
  /// Calibrated errors. Samples come without: saturation is tested before it (ImuBuffer).
  std::optional<ImuCorrection> correction{};
};

/// Noise of a known IMU part from its data sheet, as starting values; measured noise is better.
/// @param part  as in `part_names`; case, `_`, `-` and blanks do not matter
/// @return nullopt: not in the table
[[nodiscard]] std::optional<ImuNoise> noise_of_part(std::string_view part, double rate_hz);

/// Chips, and cameras and autopilots that contain them; in the order of the table.
[[nodiscard]] std::vector<std::string_view> part_names();

}  // namespace fiducap
