#pragma once

#include <string>

#include "calibration/intrinsics/intrinsics_verdict.hpp"

namespace fiducap {

/// Three views of the image: where corners were (with rings of equal angle off the axis), how far
/// they are from where the lens puts them, and how well the lens knows directions; above them the
/// verdict, below what to do about it.
/// @return an SVG document
[[nodiscard]] std::string calibration_svg(const IntrinsicsCalibration& calibration,
                                          const ImageMap& map, const IntrinsicsVerdict& verdict);

}  // namespace fiducap
