#pragma once

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// A raw pixel and how it moves.
struct LensDerivative {
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, kLensNumbers> d_lens;  ///< ∂ px / ∂ (fu fv cu cv k…)
  Eigen::Matrix<double, 2, 3> d_point;            ///< ∂ px / ∂ p_VP
};

/// @pre p_VP.z() > 0 unless the lens is equidistant
[[nodiscard]] LensDerivative differentiate(const CameraModel& camera, const Eigen::Vector3d& p_VP);

}  // namespace fiducap
