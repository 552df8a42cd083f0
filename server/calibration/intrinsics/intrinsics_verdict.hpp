#pragma once

#include <string>
#include <vector>

#include "calibration/intrinsics/image_map.hpp"
#include "calibration/intrinsics/lens_shape.hpp"

namespace fiducap {

enum class IntrinsicsGrade {
  kGood,
  kWeak,     ///< Usable; `advice` names what is weak and what would make it better.
  kUseless,  ///< Refused: must not be used. `advice` says what is wrong and what to do.
};

/// What a person wants to know of a calibration.
struct IntrinsicsVerdict {
  IntrinsicsGrade grade{IntrinsicsGrade::kGood};
  std::vector<std::string> advice;  ///< One sentence each, the worst first; empty when good.

  int images{};
  std::size_t sightings{};
  std::size_t points{};
  double covered{};          ///< Share of the image with points: of all of it, whatever the lens.
  double seen_angle_rad{};   ///< Widest angle off the axis at which a point was.
  double image_angle_rad{};  ///< Widest angle of the image itself, as far as the lens model goes.
  double tilted{};        ///< Share of sightings turned by more than 25° against the image plane.
  double tilt_rad{};      ///< Nine tenths of the sightings are turned by less.
  double depth_spread{};  ///< Distance that nine tenths are nearer than, over that of one tenth.
  double focal_sigma{};   ///< 1-sigma of the focal lengths, relative.
  double centre_sigma{};  ///< 1-sigma of the principal point, in image widths.
  LensShape shape;        ///< What the lens does to the image.
  double uncertainty_median_px{};  ///< Over the image, see ImageCell::uncertainty_px.
  double uncertainty_worst_px{};
  double reprojection_rms_px{};  ///< Per point.
  double
      misfit_px{};  ///< RMS of what residuals have in common in a part of the image, beyond noise.
  double lens_error_px{};  ///< Both: CameraMount::lens_error_px.
};

[[nodiscard]] IntrinsicsVerdict judge(const IntrinsicsCalibration& calibration,
                                      const ImageMap& map);

/// Writes into a mount how far its lens may be off: as much of each number as makes, with the
/// others, `lens_error_px`. A covariance knows nothing of what all images have in common.
void tell_lens(const IntrinsicsCalibration& calibration, const IntrinsicsVerdict& verdict,
               CameraMount& mount);

}  // namespace fiducap
