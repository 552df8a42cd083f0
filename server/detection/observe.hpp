#pragma once

#include "capture/camera_frame.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/detector_config.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// Takes the lens out of the corners of one image and drops what should not be used: ignored ids,
/// too many corrected bits, low margin, corners outside the lens model, corners that do not form a
/// convex quadrangle seen from the front.
void observe(const CornerFrame& frame, const CameraModel& camera, const TagSetConfig& tags,
             const DetectorConfig& config, TagObservations& out);

/// Why a sighting is not to be used, as far as it tells itself.
enum class Refusal { kNone, kIgnored, kCorrectedBits, kLowMargin };
[[nodiscard]] Refusal refusal_of(const TagSighting& sighting, const TagSetConfig& tags,
                                 const DetectorConfig& config);

/// Takes another lens out of the corners of a tag than observe() did.
/// @return false: they lie outside of it, or form no tag there
[[nodiscard]] bool see_through(const CameraModel& camera, TagObservation& tag);

}  // namespace fiducap
