#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "calibration/intrinsics/calibration_data.hpp"
#include "calibration/intrinsics/held_out.hpp"
#include "calibration/intrinsics/lens_covariance.hpp"
#include "calibration/intrinsics/target_shape.hpp"

namespace fiducap {

struct IntrinsicsOptions {
  /// Which lenses to try; of several the one that explains the images best is taken,
  /// of those that explain them as well the simpler one.
  std::vector<Distortion> lenses{Distortion::kRadialTangential, Distortion::kEquidistant};
  /// Use that targets stand still relative to each other, unless the images say otherwise.
  bool join_targets{true};
};

/// What a lens left unexplained.
struct LensTrial {
  Distortion distortion{};
  std::vector<int> free;  ///< Numbers that were estimated.
  double sigma_px{};      ///< Per coordinate, degrees of freedom counted.
  bool sound{true};       ///< It can be a lens, see can_be_a_lens.
};

/// A camera's intrinsics with what they stand on.
struct IntrinsicsCalibration {
  CalibrationState state;  ///< state.camera is the result.
  CalibrationData data;    ///< What was used; points without the bend of fitted sides.
  std::vector<int> free;  ///< Which of the nine lens numbers were estimated; the rest is held at 0.
  std::vector<Eigen::Vector2d> residuals;  ///< seen − predicted, in the order of `data`.
  double sigma_px{};                       ///< Noise per coordinate that the residuals show.
  LensUncertainty uncertainty;
  std::size_t rejected{};  ///< Sightings that did not fit.
  bool targets_stood_still{
      false};  ///< Several targets, and their places relative to each other were used.
  bool targets_disagree{
      false};  ///< They moved, are not flat or not of the size said: each sighting by itself.
  double
      joined_sigma_px{};  ///< Noise that is left when they are taken to stand still; 0: not tried.
  std::vector<std::string> misfits;  ///< Names of targets of which most sightings do not fit.
  HeldOut held_out;
  TargetShape shape;              ///< Of the board, when there is one.
  std::vector<LensTrial> trials;  ///< All lenses that were tried, the one taken first.
};

/// Intrinsics from scratch: focal length searched, then least squares over lens, poses and places
/// of targets in stages, wrong sightings taken out, bends of tag sides removed with the lens found
/// so far.
/// @param progress  told what is being done
/// @return Error when there is too little to say anything
[[nodiscard]] Expected<IntrinsicsCalibration> calibrate_intrinsics(
    const CalibrationData& data, const IntrinsicsOptions& options,
    const std::function<void(const std::string&)>& progress);

}  // namespace fiducap
