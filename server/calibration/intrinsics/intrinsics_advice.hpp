#pragma once

#include "calibration/intrinsics/intrinsics_verdict.hpp"

namespace fiducap {

/// Grades a calibration by what was measured about it: what is refused first, then what is weak.
void give_advice(const IntrinsicsCalibration& calibration, const ImageMap& map,
                 IntrinsicsVerdict& verdict);

}  // namespace fiducap
