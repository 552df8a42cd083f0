#pragma once

#include <optional>
#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// One lens adjusted to the images.
struct LensFit {
  CalibrationData data;  ///< Sightings that are used, bends removed.
  CalibrationState state;
  std::vector<int> free;
  double sigma_px{};  ///< Per coordinate, degrees of freedom counted.
  std::size_t rejected{};
  bool joined{false};
  bool disagree{false};      ///< Targets were to be joined, but contradict each other.
  double joined_sigma_px{};  ///< What joining them left; 0: not tried.
  std::vector<int> misfits;  ///< Targets of which joining them threw out most sightings, or all
                             ///< that do not fit when it failed.
};

/// From nothing to a fit in which every sighting stands for itself.
/// @return nullopt when no focal length explains anything
[[nodiscard]] std::optional<LensFit> fit_loose(const CalibrationData& data, Distortion kind);

/// The same with targets standing still; `loose` unchanged but for `disagree` when the images
/// contradict.
[[nodiscard]] LensFit fit_joined(const LensFit& loose);

/// Frees the third radial coefficient as well.
[[nodiscard]] LensFit fit_third_radial(const LensFit& fit);

/// The same sightings with fewer numbers free; coefficients that are not are zero.
/// @param free  ascending, part of `fit.free`
[[nodiscard]] LensFit refit(const LensFit& fit, const std::vector<int>& free);

}  // namespace fiducap
