#pragma once

#include <span>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/filter/corner_noise.hpp"
#include "estimation/filter/tag_measurement.hpp"
#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

/// Innovation and Jacobian of one tag, RCARS II-D4. A tag in the state depends on itself alone when
/// camera 0 sees it (that is what robocentric is good for); another camera adds both extrinsics; a
/// known tag depends on the body.
[[nodiscard]] TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model,
                                     const TagToUse& tag, double corner_noise_px);

/// All tags of an image.
void measure_image(const FilterState& state, int camera, const CameraModel& model,
                   std::span<const TagToUse> tags, const CornerNoise& noise, ImageMeasurement& out);

/// Where the tag stands in the axes of `camera`, by the state's mean.
[[nodiscard]] Pose predicted_tag(const FilterState& state, int camera, const TagToUse& tag);

}  // namespace fiducap::robocentric
