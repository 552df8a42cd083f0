#pragma once

#include "detection/corner_projection.hpp"

namespace fiducap {

using Matrix8d = Eigen::Matrix<double, 8, 8>;

/// Covariance of the corners of a tag when each is where two fitted sides meet: corners of a
/// slanted tag are worst along its diagonal, those of a smeared one across the motion, and the two
/// ends of a side are off together.
/// @param corners_px  in the pixels that the sigmas are in
[[nodiscard]] Matrix8d corner_covariance(const std::array<Eigen::Vector2d, 4>& corners_px,
                                         const std::array<SideSigma, 4>& sides);

}  // namespace fiducap
