#pragma once

#include <tuple>

#include "capture/lens/camera_model.hpp"

namespace fiducap {

inline CameraModel rational(CameraModel pinhole, const LensCoefficients& k) {
  pinhole.distortion = Distortion::kRational;
  pinhole.coefficients = k;
  return pinhole;
}

inline CameraModel radial_tangential(CameraModel pinhole, const LensCoefficients& k) {
  pinhole.distortion = Distortion::kRadialTangential;
  pinhole.coefficients = k;
  return pinhole;
}

inline CameraModel equidistant(CameraModel pinhole, const LensCoefficients& k) {
  pinhole.distortion = Distortion::kEquidistant;
  pinhole.coefficients = k;
  return pinhole;
}

/// For comparisons.
inline auto parts_of(const CameraModel& c) {
  return std::tuple(c.width, c.height, c.fu, c.fv, c.cu, c.cv, c.distortion, c.coefficients);
}

}  // namespace fiducap
