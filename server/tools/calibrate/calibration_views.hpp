#pragma once

#include <functional>
#include <optional>
#include <string>

#include "base/expected.hpp"
#include "calibration/intrinsics/calibration_data.hpp"
#include "detection/detector_config.hpp"
#include "tools/calibrate/calibration_images.hpp"

namespace fiducap {

/// Inner corners of a checkerboard: one less than squares.
struct Checkerboard {
  int columns{};
  int rows{};
  double square_m{};
};

/// What is to be looked for.
struct CalibrationTargets {
  std::optional<Checkerboard> checkerboard;  ///< Else tags.
  TagSetConfig tags;
};

/// All that was seen.
struct CollectedViews {
  CalibrationData data;  ///< A view per image with a target.
  std::size_t images{};  ///< Looked at.
};

/// Looks for the targets in all images. Tags whose sides are shorter than 20 px are left out: their
/// corners are worse than those of others, and they are near enough elsewhere.
/// @param progress  told how many images were looked at, and in how many there was a target
[[nodiscard]] Expected<CollectedViews> collect_views(
    CalibrationImages& images, const CalibrationTargets& targets,
    const std::function<void(std::size_t, std::size_t)>& progress);

/// The sharp ones among the views, and of those up to `most` that differ from each other as much as
/// they can: a hundred images of a camera at rest are one image.
[[nodiscard]] CalibrationData select_views(const CalibrationData& all, std::size_t most);

}  // namespace fiducap
