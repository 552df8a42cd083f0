#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/intrinsics/intrinsics_calibration.hpp"
#include "calibration/intrinsics/lens_model.hpp"

namespace fiducap {

/// A part of the image.
struct ImageCell {
  Eigen::Vector2d centre_px;
  int points{};
  double rms_px{};  ///< Reprojection, per point.
  /// Mean residual: the part that the lens model cannot represent.
  Eigen::Vector2d mean_px{Eigen::Vector2d::Zero()};
  bool in_lens{true};       ///< The lens model has a ray for the centre.
  double uncertainty_px{};  ///< 1-sigma per coordinate of the projection of the centre's ray.
};

/// The image in nearly square cells.
struct ImageMap {
  int columns{};
  int rows{};
  std::vector<ImageCell> cells;  ///< Row by row from the top.

  [[nodiscard]] const ImageCell& at(int column, int row) const {
    return cells[static_cast<std::size_t>(row * columns + column)];
  }
};

/// Smallest number of points of a covered cell.
inline constexpr int kCoveringPoints = 2;

/// Coverage, reprojection and uncertainty per part of the image. The uncertainty is that of
/// directions relative to each other: the part equal to a small rotation of the camera (weighted by
/// the positions of points) is removed, because the extrinsics are calibrated afterwards. Idea: D.
/// Kogan, mrcal, "projection uncertainty".
[[nodiscard]] ImageMap make_image_map(const IntrinsicsCalibration& calibration);

/// Angle of a raw pixel off the optical axis; nullopt outside of the lens model.
[[nodiscard]] std::optional<double> angle_of(const CameraModel& camera,
                                             const Eigen::Vector2d& raw_px);

enum class IntrinsicsGrade {
  kGood,
  kWeak,     ///< Usable; `advice` names weaknesses and how to improve.
  kUseless,  ///< Refused: must not be used. `advice` names what is wrong and what to do.
};

/// Quality of a calibration, for the user.
struct IntrinsicsVerdict {
  IntrinsicsGrade grade{IntrinsicsGrade::kGood};
  std::vector<std::string> advice;  ///< One sentence each, the worst first; empty when good.

  int images{};
  std::size_t sightings{};
  std::size_t points{};
  double covered{};          ///< Share of the image with points.
  double seen_angle_rad{};   ///< Largest angle of a point off the axis.
  double image_angle_rad{};  ///< Largest angle of the image off the axis, within the lens model.
  double tilted{};           ///< Share of sightings tilted by more than 25° to the image plane.
  double tilt_rad{};         ///< 90 % quantile of the tilt of sightings.
  double depth_spread{};     ///< 90 % quantile of the distance over its 10 % quantile.
  double focal_sigma{};      ///< 1-sigma of the focal lengths, relative.
  double centre_sigma{};     ///< 1-sigma of the principal point, in image widths.
  LensShape shape;
  double uncertainty_median_px{};  ///< Over the image, see ImageCell::uncertainty_px.
  double uncertainty_worst_px{};
  double reprojection_rms_px{};  ///< Per point.
  double misfit_px{};            ///< RMS of the cells' mean residuals, beyond noise.
  double lens_error_px{};        ///< Both: CameraMount::lens_error_px.
};

/// Measures and grades.
[[nodiscard]] IntrinsicsVerdict assess(const IntrinsicsCalibration& calibration,
                                       const ImageMap& map);

/// Grades a measured verdict and adds the advice, reasons for refusal first. Part of assess().
void add_advice(const IntrinsicsCalibration& calibration, const ImageMap& map,
                IntrinsicsVerdict& verdict);

/// Sets the lens sigmas of a mount so that together they cause `lens_error_px`: the covariance does
/// not include errors common to all images.
void set_lens_sigmas(const IntrinsicsCalibration& calibration, const IntrinsicsVerdict& verdict,
                     CameraMount& mount);

}  // namespace fiducap
