#pragma once

#include <optional>
#include <vector>

#include "calibration/intrinsics/intrinsics_calibration.hpp"

namespace fiducap {

/// A part of the image.
struct ImageCell {
  Eigen::Vector2d centre_px;
  int points{};
  double rms_px{};  ///< Reprojection, per point.
  Eigen::Vector2d mean_px{
      Eigen::Vector2d::Zero()};  ///< Mean residual: what the lens model cannot follow.
  bool in_lens{true};            ///< The lens model has a ray for the centre.
  double uncertainty_px{};       ///< 1-sigma per coordinate of where the ray of the centre is seen.
};

/// The image in cells that are nearly square.
struct ImageMap {
  int columns{};
  int rows{};
  std::vector<ImageCell> cells;  ///< Row by row from the top.

  [[nodiscard]] const ImageCell& at(int column, int row) const {
    return cells[static_cast<std::size_t>(row * columns + column)];
  }
};

/// A cell counts as covered from this many points on.
inline constexpr int kCoveringPoints = 2;

/// Coverage, reprojection and uncertainty per part of the image. The uncertainty is that of
/// directions relative to each other: what a small turn of the camera on its body would do as well
/// is taken out (weighted by where points were), since where the camera sits is calibrated after
/// this. Idea: D. Kogan, mrcal, "projection uncertainty".
[[nodiscard]] ImageMap make_image_map(const IntrinsicsCalibration& calibration);

/// Angle of a raw pixel off the optical axis; nullopt outside of the lens model.
[[nodiscard]] std::optional<double> angle_of(const CameraModel& camera,
                                             const Eigen::Vector2d& raw_px);

}  // namespace fiducap
