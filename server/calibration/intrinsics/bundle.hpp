#pragma once

#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

struct BundleOptions {
  /// Which of the nine lens numbers are estimated.
  std::vector<int> free;
  /// Huber loss: residuals beyond this pull no harder. 0: plain least squares.
  double huber_px{0};
  int max_iterations{60};
};

/// Least squares over lens, poses of groups in views and places of targets in their groups (Ceres,
/// dense Schur).
/// @return false when it did not get anywhere; the state is then as before
bool adjust(const CalibrationData& data, const BundleOptions& options, CalibrationState& state);

/// seen − predicted, one entry per point in the order of views, sightings, points; a point behind a
/// radial-tangential camera is an image width off.
[[nodiscard]] std::vector<Eigen::Vector2d> residuals(const CalibrationData& data,
                                                     const CalibrationState& state);

/// Root mean square over coordinates, two per point.
[[nodiscard]] double rms_per_coordinate(const std::vector<Eigen::Vector2d>& residuals);

/// The numbers that were fitted: lens, poses of groups, places of targets.
[[nodiscard]] std::size_t count_unknowns(const CalibrationState& state,
                                         std::size_t free_lens_numbers);

}  // namespace fiducap
