#pragma once

#include "capture/lens/lens_offset.hpp"

namespace fiducap {

/// Assumed where nothing but the images tells, 1-sigma: how far two good calibrations of one lens
/// are apart.
inline constexpr double kAssumedFocal = 3e-3;
inline constexpr double kAssumedCentre_px = 2.0;

/// A camera's lens against the configured one, as a filter sees it now.
struct LensEstimate {
  LensOffset offset;
  double focal_sigma{};  ///< 0: not estimated.
  Eigen::Vector2d centre_sigma_px{Eigen::Vector2d::Zero()};
  double k1_sigma{};

  [[nodiscard]] bool is_estimated() const {
    return focal_sigma > 0 || centre_sigma_px.maxCoeff() > 0 || k1_sigma > 0;
  }
};

}  // namespace fiducap
