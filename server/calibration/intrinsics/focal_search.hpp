#pragma once

#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"

namespace fiducap {

/// A camera to start from: principal point in the middle, no distortion, one focal length.
struct FocalStart {
  CameraModel camera;
  double rms_px{};  ///< Median over sightings of the reprojection error of their own poses.
};

/// Tries focal lengths from wide to narrow. A tag or a board is small, so that at the right focal
/// length it looks like itself through the bare lens kind nearly everywhere: no start value is
/// needed, and a fisheye is no special case.
/// @return the candidates that stand out (local minima), best first; empty when nothing can be seen
/// by any
[[nodiscard]] std::vector<FocalStart> search_focal_length(const CalibrationData& data,
                                                          Distortion kind);

}  // namespace fiducap
