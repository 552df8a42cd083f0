#pragma once

#include <span>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/filter/corner_noise.hpp"
#include "estimation/filter/tag_measurement.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// Innovation and Jacobian of one tag, RCARS II-D4: X_VT = X_WV⁻¹ X_WT. Camera and tag enter with
/// opposite signs and the same lever arm, so a common shift of both cancels exactly, wherever this
/// is linearised.
[[nodiscard]] TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model,
                                     const TagToUse& tag, const CornerNoise& noise);

/// All tags of an image. When all rows were exposed at once, for certain, they share the camera's
/// pose and come in the relative form: what measure() says, in fewer numbers.
void measure_image(const FilterState& state, int camera, const CameraModel& model,
                   std::span<const TagToUse> tags, const CornerNoise& noise, ImageMeasurement& out);

/// Where the tag stands in W: by the state, or as given.
[[nodiscard]] const Pose& place_of(const FilterState& state, const TagToUse& tag);

}  // namespace fiducap::world
