#pragma once

#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// Of a real camera, until somebody says more: no calibration leaves nothing.
[[nodiscard]] inline CameraMount calibrated_mount() {
  CameraMount mount;
  mount.lens_error_px = kUsualLensError_px;
  return mount;
}

}  // namespace fiducap
