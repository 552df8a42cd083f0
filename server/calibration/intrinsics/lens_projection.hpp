#pragma once

#include <cmath>

#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// CameraModel::project for any number type (automatic derivatives), with the lens as nine numbers:
/// fu fv cu cv and the coefficients. Smooth where an equidistant lens looks sideways or back; never
/// says that a lens has folded.
/// @param lens   nine numbers, see numbers_of
/// @param point  camera axes V; radial-tangential lenses need z > 0
template <typename T>
void project_through(Distortion kind, const T* lens, const T* point, T* px) {
  using std::atan2;
  using std::sqrt;
  const T* k = lens + 4;
  T x, y;
  if (kind == Distortion::kEquidistant) {
    const T r2 = point[0] * point[0] + point[1] * point[1];
    T scale = T(1) / point[2];  // on the axis
    if (r2 > 1e-16 * point[2] * point[2]) {
      const T r = sqrt(r2);
      const T angle = atan2(r, point[2]);
      const T s = angle * angle;
      scale = angle * (T(1) + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3])))) / r;
    }
    x = point[0] * scale;
    y = point[1] * scale;
  } else {
    const T a = point[0] / point[2];
    const T b = point[1] / point[2];
    const T s = a * a + b * b;
    const T radial = T(1) + s * (k[0] + s * (k[1] + s * k[4]));
    x = a * radial + T(2) * k[2] * a * b + k[3] * (s + T(2) * a * a);
    y = b * radial + k[2] * (s + T(2) * b * b) + T(2) * k[3] * a * b;
  }
  px[0] = lens[0] * x + lens[2];
  px[1] = lens[1] * y + lens[3];
}

}  // namespace fiducap
