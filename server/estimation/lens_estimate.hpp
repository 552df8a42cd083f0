#pragma once

#include "capture/lens/lens_offset.hpp"

namespace fiducap {

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
