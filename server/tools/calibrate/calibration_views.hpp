#pragma once

#include <functional>

#include "base/expected.hpp"
#include "calibration/intrinsics/view_collector.hpp"
#include "tools/calibrate/calibration_images.hpp"

namespace fiducap {

/// All that was seen.
struct CollectedViews {
  CalibrationData data;  ///< A view per image with a target.
  std::size_t images{};  ///< Looked at.
};

/// Looks for the targets in all images.
/// @param progress  told how many images were looked at, and in how many there was a target
[[nodiscard]] Expected<CollectedViews> collect_views(
    CalibrationImages& images, const CalibrationTargets& targets,
    const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace fiducap
