#pragma once

#include "capture/lens/camera_model.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::bench {

/// The benches' camera: 79° wide with a barrel lens, whatever its resolution, looking along body x.
[[nodiscard]] inline CameraMount barrel_camera(int width, int height) {
  const double f = 460.0 * width / 752;
  CameraMount mount;
  mount.model = {width,
                 height,
                 f,
                 f,
                 0.5 * (width - 1),
                 0.5 * (height - 1),
                 Distortion::kRadialTangential,
                 {-0.28, 0.07, 2e-4, 2e-5, 0}};
  mount.X_BV = simulation::forward_camera();
  return mount;
}

}  // namespace fiducap::bench
