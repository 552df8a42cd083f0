#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/config_check.hpp"
#include "base/pose.hpp"
#include "base/time.hpp"

namespace fiducap {

enum class Distortion {
  kNone,
  kRadialTangential,  ///< OpenCV / Kalibr `radtan`: k1 k2 p1 p2 [k3]
  kEquidistant,       ///< OpenCV fisheye / Kalibr `equidistant`: k1 k2 k3 k4
};

/// Pinhole camera with a lens. π of the paper (II-C) is `pinhole`, what the lens adds is `project`.
/// Camera axes V: z forward, x right, y down. Pixel (0, 0) is the centre of the upper-left pixel.
struct CameraModel {
  int width{};
  int height{};
  double fu{}, fv{}, cu{}, cv{};  ///< Focal lengths and principal point, pixels.
  Distortion distortion{Distortion::kNone};
  std::array<double, 5> coefficients{};

  /// Ideal pinhole pixel of a point in camera axes; @pre p_VP.z() > 0.
  [[nodiscard]] Eigen::Vector2d pinhole(const Eigen::Vector3d& p_VP) const {
    return {fu * p_VP.x() / p_VP.z() + cu, fv * p_VP.y() / p_VP.z() + cv};
  }

  /// Raw pixel of a point in camera axes, lens included.
  /// @return nullopt behind the camera, or where the distortion polynomial has folded back.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_VP) const;

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// An ideal pinhole pixel and how it moves with the raw one.
struct UndistortedPixel {
  Eigen::Vector2d px;              ///< In the pinhole camera of the same fu fv cu cv.
  Eigen::Matrix2d ideal_from_raw;  ///< ∂ ideal / ∂ raw: carries pixel noise through the lens.
};

/// Takes the lens out of raw pixels (OpenCV `undistortPoints` / `fisheye::undistortPoints`,
/// iterated to convergence).
/// @return one entry per pixel; nullopt where the ray is more than `max_angle_rad` off the axis or
/// did not converge.
[[nodiscard]] std::optional<UndistortedPixel> undistort(const CameraModel& camera,
                                                        const Eigen::Vector2d& raw_px,
                                                        double max_angle_rad = 1.45);

/// What a calibration leaves, told or not: of printed tags it is hardly better.
inline constexpr double kUsualLensError_px = 0.05;
inline constexpr double kLargestLensError_px = 10;

/// A camera on a body: lens, place, time.
struct CameraMount {
  CameraModel model;
  Pose X_BV;                       ///< Extrinsics: camera axes in body axes (EuRoC's T_BS).
  double position_sigma_m{0.005};  ///< How far X_BV may be off, per axis, 1-sigma.
  double rotation_sigma_rad{0.00873};
  Duration time_shift{0};  ///< t_imu = t_camera + time_shift (Kalibr timeshift_cam_imu).
  /// How far time_shift may be off, 1-sigma; 0: exact.
  double time_shift_sigma_s{0.02};
  double readout_s{0.0};  ///< Rolling shutter: first row to last row; the stamp is that of the
                          ///< middle row. 0: global.
  double readout_sigma_s{0.0};  ///< 0: readout_s is exact.
  /// How far the model may be off, 1-sigma: a guessed lens says so, and is learned. 0: as
  /// calibrated.
  double focal_sigma{0.0};      ///< Of fu and fv together, relative.
  double centre_sigma_px{0.0};  ///< Of cu and cv, each.
  double k1_sigma{0.0};         ///< Of the first coefficient of distortion.
  /// How far corners are off by what the model does not follow, 1-sigma per coordinate: no noise,
  /// but the same again wherever in the image a tag was before. 0: the model is exact.
  double lens_error_px{0.0};
  double rate_hz{20.0};
};

}  // namespace fiducap
