#pragma once

#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

struct BundleOptions {
  /// Indices of the estimated lens parameters.
  std::vector<int> free;
  /// Threshold of the Huber loss. 0: least squares.
  double huber_px{0};
};

/// Least squares over lens, poses of groups in views and poses of targets in their groups (Ceres,
/// dense Schur).
/// @return false when it failed; the state is unchanged then
bool adjust(const CalibrationData& data, const BundleOptions& options, CalibrationState& state);

/// Measured − predicted, one entry per point in the order of views, sightings, points; an image
/// width for points behind a radial-tangential camera.
[[nodiscard]] std::vector<Eigen::Vector2d> residuals(const CalibrationData& data,
                                                     const CalibrationState& state);

/// Root mean square over coordinates, two per point.
[[nodiscard]] double rms_per_coordinate(const std::vector<Eigen::Vector2d>& residuals);

/// Number of unknowns: lens, poses of groups, relative poses of targets.
[[nodiscard]] std::size_t count_unknowns(const CalibrationState& state,
                                         std::size_t free_lens_numbers);

}  // namespace fiducap
