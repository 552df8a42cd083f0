#pragma once

#include <string>

#include "capture/lens/camera_model.hpp"
#include "estimation/body_filter.hpp"

namespace fiducap {

/// One line for people: what a session has learned about a camera, and what its motion could not
/// show. Example: `camera 0: position ±2.1 mm, rotation ±0.4 mrad, clock +31.2 ±0.1 ms`. A number
/// whose sigma is hardly smaller than what was told beforehand is named as not shown, with what to
/// do.
[[nodiscard]] std::string calibration_text(std::size_t camera, const ExtrinsicsEstimate& learned,
                                           const CameraMount& told);

}  // namespace fiducap
