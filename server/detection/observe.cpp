#include "detection/observe.hpp"

#include <algorithm>

#include "detection/corner_sigma.hpp"
#include "detection/side_bend.hpp"
#include "detection/tag_family_list.hpp"

namespace fiducap {

namespace {

/// A printed tag seen from the front: its four corners run counter-clockwise on paper, and so in
/// the image.
bool is_front_view(const std::array<Eigen::Vector2d, 4>& px) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d a = px[(i + 1) % 4] - px[i];
    const Eigen::Vector2d b = px[(i + 2) % 4] - px[(i + 1) % 4];
    if (!(a.x() * b.y() - a.y() * b.x() < 0)) return false;  // v grows down; NaN fails too
  }
  return true;
}

bool undistort_corners(const std::array<Eigen::Vector2d, 4>& raw_px, const CameraModel& camera,
                       TagObservation& out) {
  for (std::size_t i = 0; i < 4; ++i) {
    const auto pixel = undistort(camera, raw_px[i]);
    if (!pixel) return false;
    out.corners_px[i] = pixel->px;
    out.ideal_from_raw[i] = pixel->ideal_from_raw;
    out.raw_px[i] = raw_px[i];
  }
  return is_front_view(out.corners_px);
}

void drop_doubled_ids(std::vector<TagObservation>& tags) {
  std::sort(tags.begin(), tags.end(),
            [](const auto& a, const auto& b) { return a.tag_id < b.tag_id; });
  auto keep = tags.begin();
  for (auto run = tags.begin(); run != tags.end();) {
    const auto end =
        std::find_if(run, tags.end(), [&](const auto& t) { return t.tag_id != run->tag_id; });
    if (end - run == 1) *keep++ = *run;
    run = end;
  }
  tags.erase(keep, tags.end());
}

}  // namespace

bool see_through(const CameraModel& camera, TagObservation& tag) {
  const std::array<Eigen::Vector2d, 4> raw_px = tag.raw_px;
  return undistort_corners(raw_px, camera, tag);
}

Refusal refusal_of(const TagSighting& sighting, const TagSetConfig& tags,
                   const DetectorConfig& config) {
  if (std::find(tags.ignore.begin(), tags.ignore.end(), sighting.tag_id) != tags.ignore.end())
    return Refusal::kIgnored;
  if (sighting.hamming > tags.max_hamming) return Refusal::kCorrectedBits;
  // 0: the source has no margin to judge by.
  if (sighting.decision_margin > 0 && sighting.decision_margin < config.min_decision_margin)
    return Refusal::kLowMargin;
  return Refusal::kNone;
}

void observe(const CornerFrame& frame, const CameraModel& camera, const TagSetConfig& tags,
             const DetectorConfig& config, TagObservations& out) {
  out.camera = frame.camera;
  out.exposed_at = frame.exposed_at;
  out.clock_shift = frame.clock_shift;
  out.tags.clear();
  const TagFamilyFacts* family = find_tag_family(tags.family);
  const int modules = family != nullptr ? family->edge_modules : kUsualModules;
  for (const TagSighting& sighting : frame.tags) {
    if (refusal_of(sighting, tags, config) != Refusal::kNone) continue;
    TagObservation tag;
    tag.tag_id = sighting.tag_id;
    tag.hamming = sighting.hamming;
    tag.decision_margin = sighting.decision_margin;
    tag.edge_m = tags.edge_of(sighting.tag_id);
    const auto raw_px = frame.fitted_straight_sides ? unbend_corners(camera, sighting.corners_px)
                                                    : sighting.corners_px;
    tag.sides = with_what_lasts(side_sigmas(sighting, frame.pixel_noise, modules),
                                sighting.corners_px, modules);
    tag.corner_sigma_px = corner_sigma_px(sighting.corners_px, tag.sides);
    for (std::size_t i = 0; i < 4; ++i)
      tag.rows[i] = raw_px[i].y() / std::max(1, camera.height - 1) - 0.5;
    if (undistort_corners(raw_px, camera, tag)) out.tags.push_back(tag);
  }
  drop_doubled_ids(out.tags);
  out.points.clear();
  for (const PointSighting& point : frame.points) {
    if (const auto pixel = undistort(camera, point.px))
      out.points.push_back({point.track, point.age, pixel->px, pixel->ideal_from_raw});
  }
}

}  // namespace fiducap
