#pragma once

#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

using LensCovariance = Eigen::Matrix<double, kLensNumbers, kLensNumbers>;

/// How well an adjusted state knows its lens.
struct LensUncertainty {
  LensCovariance covariance{
      LensCovariance::Zero()};  ///< Zero rows where a number is held. Everything else unknown too.
  /// What the images say about white noise: the scatter of what each image by itself pulls at the
  /// lens, over what white noise of `sigma_px` would do; 1 is white. Errors that the corners of an
  /// image share make it grow. The covariance has it in when it is above 1.
  double correlation{1};
  /// The same for the focal lengths alone, in sigma: large when images were taken with several
  /// focal lengths, each explained by another distance.
  double focal_scatter{1};
  double condition{1};     ///< Of the normal equations, their diagonal scaled to 1.
  bool determined{false};  ///< False: the normal equations are singular; the rest means nothing.
};

/// @param free      indices of the estimated lens numbers, ascending
/// @param sigma_px  noise per coordinate
[[nodiscard]] LensUncertainty uncertainty_of(const CalibrationData& data,
                                             const CalibrationState& state,
                                             const std::vector<int>& free, double sigma_px);

}  // namespace fiducap
