#pragma once

#include <Eigen/Core>
#include <cmath>

namespace fiducap {

/// What a filter has learned of two variances, that of the IMU's noises (so many times the declared
/// one) and that of the images' stamps, s².
struct LearnedNoise {
  Eigen::Vector2d applied{1.0, 0.0};
  /// About `applied`, forgetting slowly: Σ of the likelihood's derivatives and of their expected
  /// curvature.
  Eigen::Vector2d derivative{Eigen::Vector2d::Zero()};
  Eigen::Matrix2d information{Eigen::Matrix2d::Zero()};
  /// Σ of the derivatives' third cumulants: a few images with much motion skew them.
  Eigen::Vector2d third{Eigen::Vector2d::Zero()};
  Eigen::Vector2d weighed_at{1.0, 0.0};  ///< `applied`, when these were last weighed by it.

  [[nodiscard]] double imu_variance() const { return applied(0); }
  [[nodiscard]] double imu_information() const { return information(0, 0); }
  /// In sigmas: whether the images ask for a larger variance than the applied one.
  [[nodiscard]] double imu_score() const {
    return information(0, 0) > 0 ? derivative(0) / std::sqrt(information(0, 0)) : 0.0;
  }
};

}  // namespace fiducap
