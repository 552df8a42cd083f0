#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "calibration/intrinsics/lens_fit.hpp"
#include "calibration/intrinsics/lens_uncertainty.hpp"

namespace fiducap {

/// Images with a target, below which there is no calibration.
inline constexpr std::ptrdiff_t kFewestViews = 5;

struct IntrinsicsOptions {
  /// Lenses to try; the one with the smallest residuals is used, of equally good ones the one with
  /// fewer parameters.
  std::vector<Distortion> lenses{Distortion::kRadialTangential, Distortion::kEquidistant};
  /// Use constant relative poses of targets, unless the images contradict.
  bool join_targets{true};
};

/// Residuals of one lens.
struct LensTrial {
  Distortion distortion{};
  std::vector<int> free;  ///< Estimated parameters.
  double sigma_px{};      ///< Per coordinate, with degrees of freedom.
  bool sound{true};       ///< Plausible, see can_be_a_lens.
};

/// A camera's intrinsics with all evidence.
struct IntrinsicsCalibration : LensFit {   ///< state.camera is the result.
  std::vector<Eigen::Vector2d> residuals;  ///< Measured − predicted, in the order of `data`.
  LensUncertainty uncertainty;
  HeldOut held_out;
  TargetShape shape;              ///< Of the board, if any.
  std::vector<LensTrial> trials;  ///< All lenses tried, the used one first.
};

/// Intrinsics without start values: focal length by search, then least squares over lens, poses and
/// layout of targets in stages, with outlier rejection. The bias of fitted sides is removed with
/// the current lens.
/// @param progress  called with the current step
/// @return Error when there are too few data
[[nodiscard]] Expected<IntrinsicsCalibration> calibrate_intrinsics(
    const CalibrationData& data, const IntrinsicsOptions& options,
    const std::function<void(const std::string&)>& progress);

}  // namespace fiducap
