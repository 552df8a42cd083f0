#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "capture/camera_frame.hpp"
#include "capture/lens/camera_model.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

/// Which image: keys its noise.
struct ImageKey {
  std::uint64_t seed{};
  int camera{};
  std::uint64_t k{};  ///< Counts the exposures of this camera, dropped ones too.
};

/// Where the camera stands when a row is exposed. @param row  −0.5 first … +0.5 last row of the
/// image
using CameraPath = std::function<Pose(double row)>;

/// The sightings that a detector would report, without rendering: projected corners with white
/// noise, by the rules of CameraSimulation (all corners inside the image, side, tilt, chance).
/// Sorted by id; an id that appears twice is left out, as TagDetector does.
/// @param X_WV  the same for all rows with a global shutter
/// @param tags  as they hang in this image, ids as printed
void sight_corners(const CameraModel& model, const CameraPath& X_WV,
                   const std::vector<RecordedTag>& tags, const CameraSimulation& rules,
                   const ImageKey& key, std::vector<TagSighting>& out);

}  // namespace fiducap::simulation
