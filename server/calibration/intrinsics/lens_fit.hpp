#pragma once

#include <optional>
#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// One lens adjusted to the images.
struct LensFit {
  CalibrationData data;  ///< Used sightings, corners without the bias of fitted sides.
  CalibrationState state;
  std::vector<int> free;  ///< Indices of the estimated lens parameters.
  double sigma_px{};      ///< Per coordinate, with degrees of freedom.
  std::size_t rejected{};
  bool joined{false};
  bool disagree{false};      ///< Targets were to be joined, but contradict each other.
  double joined_sigma_px{};  ///< Sigma with joined targets; 0: not tried.
  std::vector<int> misfits;  ///< Targets with most sightings rejected by joining.
};

/// Fits a lens with independent poses of all sightings.
/// @return nullopt when no focal length explains the images
[[nodiscard]] std::optional<LensFit> fit_separate(const CalibrationData& data, Distortion kind);

/// The same with constant relative poses of targets; when the images contradict that, `separate`
/// with `disagree` set.
[[nodiscard]] LensFit fit_joined(const LensFit& separate);

/// Frees the third radial coefficient as well.
[[nodiscard]] LensFit fit_third_radial(const LensFit& fit);

/// The same sightings with fewer free parameters; fixed coefficients are zero.
/// @param free  ascending, subset of `fit.free`
[[nodiscard]] LensFit refit(const LensFit& fit, const std::vector<int>& free);

}  // namespace fiducap
