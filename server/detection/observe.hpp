#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "capture/camera_frame.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/detector_config.hpp"
#include "detection/tag_observation.hpp"

namespace fiducap {

/// Undistorts the corners of one image. Drops ignored ids, too many corrected bits, low margins,
/// ids that occur twice, corners outside the lens model, and corners that do not form a convex
/// quadrangle seen from the front.
void observe(const CornerFrame& frame, const CameraModel& camera, const TagSetConfig& tags,
             const DetectorConfig& config, TagObservations& out);

/// Sorts by id and removes all tags whose id occurs more than once.
template <typename Tag>
void drop_doubled_ids(std::vector<Tag>& tags) {
  std::ranges::sort(tags, {}, &Tag::tag_id);
  auto keep = tags.begin();
  for (auto run = tags.begin(); run != tags.end();) {
    const auto end =
        std::find_if(run, tags.end(), [&](const Tag& tag) { return tag.tag_id != run->tag_id; });
    if (end - run == 1) *keep++ = *run;
    run = end;
  }
  tags.erase(keep, tags.end());
}

/// Why the configuration excludes a sighting.
enum class Rejection { kNone, kIgnored, kCorrectedBits, kLowMargin };
[[nodiscard]] Rejection rejection_of(const TagSighting& sighting, const TagSetConfig& tags,
                                     const DetectorConfig& config);

/// Undistorts the corners of an observed tag again, with another lens.
/// @return false: they lie outside of it, or form no tag there
[[nodiscard]] bool undistort_tag(const CameraModel& camera, TagObservation& tag);

/// Intersections of straight lines fitted to the distorted sides of a tag. Models a detector that
/// fits each side by least squares over its length (libapriltag's edge refinement): at k1 = -0.28
/// its corners are 0.25 px RMS off for tags of 40 px and more.
/// @param ideal_px  true corners, undistorted
/// @return raw pixels; nullopt where a side leaves the lens model
[[nodiscard]] std::optional<TagCorners> corners_of_fitted_sides(const CameraModel& camera,
                                                                const TagCorners& ideal_px);

/// Removes that error from corners of fitted sides; unchanged without distortion.
[[nodiscard]] TagCorners unbend_corners(const CameraModel& camera, const TagCorners& raw_px);

}  // namespace fiducap
