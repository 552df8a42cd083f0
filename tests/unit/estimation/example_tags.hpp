#pragma once

#include <random>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {

inline CameraModel example_camera() {
  CameraModel camera;
  camera.width = 752;
  camera.height = 480;
  camera.fu = 460;
  camera.fv = 455;
  camera.cu = 376;
  camera.cv = 240;
  return camera;
}

/// A tag as a camera with a lens sees it.
inline TagObservation example_observation(int tag_id, double edge_m, const Pose& X_VT,
                                          const CameraModel& camera) {
  TagObservation seen;
  seen.tag_id = tag_id;
  seen.edge_m = edge_m;
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<std::size_t>(i);
    seen.corners_px[k] = camera.pinhole(X_VT * tag_corner(i, edge_m));
    seen.raw_px[k] = seen.corners_px[k];
    seen.ideal_from_raw[k] << 1.1, 0.02, -0.03, 0.95;
  }
  return seen;
}

/// The same without a lens, with noise on its corners.
template <class Random>
TagObservation noisy_observation(int tag_id, double edge_m, const Pose& X_VT,
                                 const CameraModel& camera, double sigma_px, Random& random) {
  std::normal_distribution<double> noise(0, sigma_px);
  TagObservation seen = example_observation(tag_id, edge_m, X_VT, camera);
  for (std::size_t k = 0; k < 4; ++k) {
    seen.ideal_from_raw[k].setIdentity();
    seen.corners_px[k] += Eigen::Vector2d(noise(random), noise(random));
    seen.raw_px[k] = seen.corners_px[k];
  }
  return seen;
}

}  // namespace fiducap
