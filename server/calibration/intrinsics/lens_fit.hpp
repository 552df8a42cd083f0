#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// One lens adjusted to the images.
struct LensFit {
  CalibrationData data;  ///< Used sightings, corners without the bias of fitted sides.
  CalibrationState state;
  std::vector<int> free;       ///< Indices of the estimated lens parameters; the others are 0.
  double sigma_px{};           ///< Per coordinate, with degrees of freedom.
  std::size_t rejected{};      ///< Sightings that did not fit.
  bool targets_joined{false};  ///< Constant relative poses of several targets were used.
  /// Targets moved, are not flat or have another size; each sighting has its own pose.
  bool targets_disagree{false};
  double joined_sigma_px{};          ///< Sigma with joined targets; 0: not tried.
  std::vector<std::string> misfits;  ///< Names of targets with most sightings rejected by joining.
};

/// Fits a lens with independent poses of all sightings.
/// @return nullopt when no focal length explains the images
[[nodiscard]] std::optional<LensFit> fit_separate(const CalibrationData& data, Distortion kind);

/// The same with constant relative poses of targets; when the images contradict that, `separate`
/// with `targets_disagree` set.
[[nodiscard]] LensFit fit_joined(const LensFit& separate);

/// The same with other free parameters, more of them.
[[nodiscard]] LensFit fit_freer(const LensFit& fit, const std::vector<int>& free);

/// The same sightings with fewer free parameters; fixed coefficients are zero.
/// @param free  ascending, subset of `fit.free`
[[nodiscard]] LensFit refit(const LensFit& fit, const std::vector<int>& free);

}  // namespace fiducap
