#pragma once

#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// How a lens differs from the configured one: its first coefficient of radial distortion is `k1`
/// larger, then raw pixels stand (1 + focal) times as far from the principal point, and that is
/// `centre_px` off.
struct LensOffset {
  double focal{};
  Eigen::Vector2d centre_px{Eigen::Vector2d::Zero()};
  double k1{};

  [[nodiscard]] bool is_none() const { return focal == 0 && centre_px.isZero(0) && k1 == 0; }
  /// The lens as it is, then.
  [[nodiscard]] CameraModel applied_to(CameraModel configured) const {
    configured.fu *= 1 + focal;
    configured.fv *= 1 + focal;
    configured.cu += centre_px.x();
    configured.cv += centre_px.y();
    if (k1 == 0) return configured;
    if (configured.distortion == Distortion::kNone) {
      configured.distortion = Distortion::kRadialTangential;
      configured.coefficients = {};
    }
    configured.coefficients[0] += k1;
    return configured;
  }
};

}  // namespace fiducap
