#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/pose.hpp"
#include "base/time.hpp"

namespace fiducap {

enum class Distortion {
  kNone,
  kRadialTangential,  ///< OpenCV / Kalibr `radtan`: k1 k2 p1 p2 [k3]
  kEquidistant,       ///< OpenCV fisheye / Kalibr `equidistant`: k1 k2 k3 k4
  kRational,          ///< OpenCV, ROS `rational_polynomial`: k1 k2 p1 p2 k3 k4 k5 k6
};

/// In OpenCV's order.
using LensCoefficients = std::array<double, 8>;

/// Number of coefficients of a model.
[[nodiscard]] constexpr std::size_t coefficients_of(Distortion distortion) {
  constexpr std::array<std::size_t, 4> kOf{0, 5, 4, 8};
  return kOf[static_cast<std::size_t>(distortion)];
}

/// Pinhole camera with a lens. π of the paper (II-C) is `pinhole`; `project` adds the distortion.
/// Camera axes V: z forward, x right, y down. Pixel (0, 0) is the centre of the upper-left pixel.
struct CameraModel {
  int width{};                    ///< Of the images, pixels.
  int height{};                   ///< Of the images, pixels.
  double fu{}, fv{}, cu{}, cv{};  ///< Focal lengths and principal point, pixels.
  Distortion distortion{Distortion::kNone};
  LensCoefficients coefficients{};  ///< Beyond coefficients_of(distortion) they are zero.

  /// Ideal pinhole pixel of a point in camera axes; @pre p_VP.z() > 0.
  [[nodiscard]] Eigen::Vector2d pinhole(const Eigen::Vector3d& p_VP) const {
    return {fu * p_VP.x() / p_VP.z() + cu, fv * p_VP.y() / p_VP.z() + cv};
  }

  /// Distorted pixel of a point in camera axes.
  /// @return nullopt behind the camera, or where the distortion polynomial has folded back.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_VP) const;

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// The coefficients as files list them: a k3 of zero is left out of a radial-tangential lens.
[[nodiscard]] std::span<const double> listed_coefficients(const CameraModel& camera);

/// Sets the distortion by the names that calibration files, ROS and COLMAP use: `radtan`,
/// `plumb_bob`, `rational_polynomial`, `equidistant`, `fisheye`, `kb4`, … The numbers are in
/// OpenCV's order. Longer lists are accepted when the rest is zero; 8 numbers are a rational lens
/// by any radial name. Without a name, or by an unknown one, zeros are no distortion; without a
/// name more than four numbers are OpenCV's.
/// @return Error for other models (`omni`, `ds`, …) or another number of coefficients
[[nodiscard]] Expected<void> set_lens(CameraModel& camera, const std::string& name,
                                      std::span<const double> coefficients);

/// The name that EuRoC or ROS uses.
[[nodiscard]] std::string name_of(Distortion distortion);

/// An ideal pinhole pixel and its derivative by the raw one.
struct UndistortedPixel {
  Eigen::Vector2d px;              ///< In the pinhole camera of the same fu fv cu cv.
  Eigen::Matrix2d ideal_from_raw;  ///< ∂ ideal / ∂ raw: propagates pixel noise.
};

/// Removes the distortion of a raw pixel, iterated to convergence (OpenCV `undistortPoints`).
/// @return nullopt when the ray is more than `max_angle_rad` off the axis, or without convergence
[[nodiscard]] std::optional<UndistortedPixel> undistort(const CameraModel& camera,
                                                        const Eigen::Vector2d& raw_px,
                                                        double max_angle_rad = 1.45);

/// Typical residual error of a calibrated lens.
inline constexpr double kUsualLensError_px = 0.05;
inline constexpr double kLargestLensError_px = 10;

/// A camera on a body: lens, extrinsics, clock. Sigmas are 1-sigma; 0: exact.
struct CameraMount {
  CameraModel model;
  Pose X_BV;                           ///< Extrinsics: camera axes in body axes (EuRoC's T_BS).
  double position_sigma_m{0.005};      ///< Of X_BV, per axis.
  double rotation_sigma_rad{0.00873};  ///< Of X_BV, per axis.
  Duration time_shift{0};           ///< t_imu = t_camera + time_shift (Kalibr timeshift_cam_imu).
  double time_shift_sigma_s{0.02};  ///< Of `time_shift_s`.
  /// Rolling shutter: first row to last row; the stamp is that of the middle row. 0: global.
  double readout_s{0.0};
  double readout_sigma_s{0.0};  ///< Of `readout_s`.
  // Of the lens model; a guessed lens has large ones, and is estimated.
  double focal_sigma{0.0};      ///< Of fu and fv together, relative.
  double centre_sigma_px{0.0};  ///< Of cu and cv, each.
  double k1_sigma{0.0};         ///< Of the first coefficient of distortion.
  /// Unmodelled distortion per coordinate: not noise, but constant at each place of the image.
  double lens_error_px{0.0};
  double rate_hz{20.0};  ///< Images per second.
};

/// Default of a real camera: a calibration leaves a residual error.
[[nodiscard]] inline CameraMount calibrated_mount() {
  CameraMount mount;
  mount.lens_error_px = kUsualLensError_px;
  return mount;
}

/// The lens sigmas are those of a calibration, not of a guess. False for an exact lens.
[[nodiscard]] inline bool has_calibrated_lens(const CameraMount& mount) {
  constexpr double kFocal = 5e-3;
  constexpr double kDistortion = 0.02;
  return mount.focal_sigma > 0 && mount.focal_sigma <= kFocal && mount.k1_sigma <= kDistortion;
}

/// Difference of a lens from the configured one: first its radial k1 is `k1` larger, then raw
/// pixels are (1 + focal) times as far from the principal point, which is shifted by `centre_px`.
struct LensOffset {
  double focal{};
  Eigen::Vector2d centre_px{Eigen::Vector2d::Zero()};
  double k1{};

  [[nodiscard]] bool is_none() const { return focal == 0 && centre_px.isZero(0) && k1 == 0; }
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
