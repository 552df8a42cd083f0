#pragma once

#include <string>
#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"
#include "calibration/intrinsics/lens_model.hpp"

namespace fiducap {

struct LensFit;

using LensCovariance = Eigen::Matrix<double, kLensNumbers, kLensNumbers>;

/// Uncertainty of the lens of an adjusted state.
struct LensUncertainty {
  /// Marginal, all poses unknown; zero rows for fixed parameters.
  LensCovariance covariance{LensCovariance::Zero()};
  /// Test of white noise: scatter of the images' contributions to the lens, relative to the one of
  /// white noise of `sigma_px`; 1 is white. Errors shared by the corners of an image increase it.
  /// The covariance includes it when it is above 1.
  double correlation{1};
  /// The same for the focal lengths alone, in sigma: large when images were taken with several
  /// focal lengths, each explained by another distance.
  double focal_scatter{1};
  double condition{1};     ///< Of the normal equations, their diagonal scaled to 1.
  bool determined{false};  ///< False: the normal equations are singular; the rest is invalid.
};

/// @param free      indices of the estimated lens parameters, ascending
/// @param sigma_px  noise per coordinate
[[nodiscard]] LensUncertainty uncertainty_of(const CalibrationData& data,
                                             const CalibrationState& state,
                                             const std::vector<int>& free, double sigma_px);

/// Flatness and side ratio of a board. Zero without a board, or when the images do not show them.
struct TargetShape {
  std::string name;
  double size_m{};      ///< Longer side.
  double bend{};        ///< Middle against edge, out of the plane, relative to the longer side.
  double bend_sigma{};  ///< 1-sigma.
  double stretch{};     ///< Ratio of the sides x over y, relative to the nominal one, minus one.
  double stretch_sigma{};
  bool known{false};
};

/// One Gauss-Newton step with the shape of the most observed board free, from a state adjusted with
/// the nominal shape. Shows the part of a bend that lens and poses cannot absorb.
/// @param free  indices of the estimated lens parameters, ascending
[[nodiscard]] TargetShape estimate_target_shape(const CalibrationData& data,
                                                const CalibrationState& state,
                                                const std::vector<int>& free);

/// Cross-validation: the lens on images that it was not fitted to.
struct HeldOut {
  bool tried{false};  ///< False: too few images.
  /// Residuals of each half of the images (even, odd) with the lens of the other half and free
  /// poses, relative to those with their own lens. 1: no overfitting.
  double ratio{1};
  /// Focal lengths of the first and the second half of the recording, with 1-sigma.
  double first_focal{}, first_sigma{};
  double second_focal{}, second_sigma{};

  /// The focal length of the second half over that of the first.
  [[nodiscard]] double focal_step() const { return second_focal / first_focal; }
  /// The step in its own sigma.
  [[nodiscard]] double focal_step_sigma() const;
};

[[nodiscard]] HeldOut hold_out(const LensFit& fit);

}  // namespace fiducap
