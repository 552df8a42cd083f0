#pragma once

#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// Of a real camera, until somebody says more: no calibration leaves nothing.
[[nodiscard]] inline CameraMount calibrated_mount() {
  CameraMount mount;
  mount.lens_error_px = kUsualLensError_px;
  return mount;
}

/// Whether what is told of the lens is what a calibration leaves open; more is a guess. Of a lens
/// that is told as exact it is false.
[[nodiscard]] inline bool tells_a_calibration(const CameraMount& mount) {
  constexpr double kFocal = 5e-3;
  constexpr double kDistortion = 0.02;
  return mount.focal_sigma > 0 && mount.focal_sigma <= kFocal && mount.k1_sigma <= kDistortion;
}

}  // namespace fiducap
