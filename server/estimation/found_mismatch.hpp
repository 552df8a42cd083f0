#pragma once

#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// Assumed 1-sigma of a lens that images alone cannot test: difference of two good calibrations of
/// one lens.
inline constexpr double kAssumedFocal = 3e-3;
inline constexpr double kAssumedCentre_px = 2.0;

/// A camera's lens relative to the configured one, as estimated by a filter.
struct LensEstimate {
  LensOffset offset;
  double focal_sigma{};  ///< 0: not estimated.
  Eigen::Vector2d centre_sigma_px{Eigen::Vector2d::Zero()};
  double k1_sigma{};

  [[nodiscard]] bool is_estimated() const {
    return focal_sigma > 0 || centre_sigma_px.maxCoeff() > 0 || k1_sigma > 0;
  }
};

/// A difference between configuration and images, as estimated by a filter, which applies it.
struct FoundMismatch {
  enum class Kind {
    kFocalLength,    ///< `value`: relative; 0.01: the focal length is 1 % longer.
    kCentreU,        ///< Principal point, px to the right.
    kCentreV,        ///< Principal point, px down.
    kDistortion,     ///< `value`: difference of the first distortion coefficient.
    kLens,           ///< `lens` was estimated as a parameter. `value`: its relative focal length.
    kReadout,        ///< Rolling shutter, first row to last, s; configured: 0.
    kAllPrints,      ///< All tags are larger, relative.
    kOnePrint,       ///< One tag is larger, relative, beyond kAllPrints.
    kImuNoise,       ///< Factor of the IMU's configured noise densities.
    kGyroRange,      ///< Saturated rate, rad/s.
    kAccelRange,     ///< Saturated specific force, m/s².
    kStampJitter,    ///< Independent error of each image's stamp, 1-sigma, s.
    kAccelScale,     ///< `axes`: the accelerometer reads this much more, relative.
    kGyroTurn,       ///< `axes`: rotation of the gyroscope against the accelerometer, rad.
    kGyroScale,      ///< `axes`: the gyroscope reads this much more, relative.
    kGyroDrift,      ///< `axes`: change of the gyroscope's bias, rad/s².
    kMountPosition,  ///< `axes`: position of the camera on the body beyond the configured one, m.
    kMountRotation,  ///< `axes`: its rotation vector, B axes, rad.
  } kind{};
  int camera{-1};
  int tag_id{-1};
  double value{};
  double sigma{};
  LensEstimate lens{};
  Eigen::Vector3d axes{Eigen::Vector3d::Zero()};
  Eigen::Vector3d axes_sigma{Eigen::Vector3d::Zero()};
  /// Something is wrong, but the data do not tell whether this or another ambiguous finding.
  bool is_ambiguous{false};
};

}  // namespace fiducap
