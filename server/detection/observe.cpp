#include "detection/observe.hpp"

#include <algorithm>

#include "detection/corner_sigma.hpp"
#include "detection/side_fit.hpp"
#include "detection/side_scan.hpp"
#include "detection/tag_family.hpp"

namespace fiducap {
namespace {

// Nine points and two rounds would leave 0.002 px of large tags.
constexpr int kPointsPerLine = 21;
constexpr int kRounds = 3;

/// Least squares.
Line fit_line(const std::array<Eigen::Vector2d, kPointsPerLine>& points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : points) mean += p / kPointsPerLine;
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const auto& p : points) scatter += (p - mean) * (p - mean).transpose();
  return principal_line(mean, scatter);
}

/// Seen from the front the four corners run counter-clockwise, as on paper.
bool is_front_view(const TagCorners& px) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d a = px[(i + 1) % 4] - px[i];
    const Eigen::Vector2d b = px[(i + 2) % 4] - px[(i + 1) % 4];
    if (!(a.x() * b.y() - a.y() * b.x() < 0)) return false;  // v grows down; also for NaN
  }
  return true;
}

bool undistort_corners(const TagCorners& raw_px, const CameraModel& camera, TagObservation& out) {
  for (std::size_t i = 0; i < 4; ++i) {
    const auto pixel = undistort(camera, raw_px[i]);
    if (!pixel) return false;
    out.corners_px[i] = pixel->px;
    out.ideal_from_raw[i] = pixel->ideal_from_raw;
    out.raw_px[i] = raw_px[i];
  }
  return is_front_view(out.corners_px);
}

}  // namespace

bool undistort_tag(const CameraModel& camera, TagObservation& tag) {
  return undistort_corners(TagCorners(tag.raw_px), camera, tag);
}

Rejection rejection_of(const TagSighting& sighting, const TagSetConfig& tags,
                       const DetectorConfig& config) {
  if (std::ranges::count(tags.ignore, sighting.tag_id) > 0) return Rejection::kIgnored;
  if (sighting.hamming > tags.max_hamming) return Rejection::kCorrectedBits;
  // 0: the source measures no margin.
  if (sighting.decision_margin > 0 && sighting.decision_margin < config.min_decision_margin)
    return Rejection::kLowMargin;
  return Rejection::kNone;
}

void observe(const CornerFrame& frame, const CameraModel& camera, const TagSetConfig& tags,
             const DetectorConfig& config, TagObservations& out) {
  out.camera = frame.camera;
  out.exposed_at = frame.exposed_at;
  out.clock_shift = frame.clock_shift;
  out.tags.clear();
  const TagFamilyFacts* family = find_tag_family(tags.family);
  const int cells = family != nullptr ? family->edge_cells : kDefaultCells;
  for (const TagSighting& sighting : frame.tags) {
    if (rejection_of(sighting, tags, config) != Rejection::kNone) continue;
    TagObservation tag;
    tag.tag_id = sighting.tag_id;
    tag.hamming = sighting.hamming;
    tag.decision_margin = sighting.decision_margin;
    tag.edge_m = tags.edge_of(sighting.tag_id);
    const auto raw_px = frame.fitted_straight_sides ? unbend_corners(camera, sighting.corners_px)
                                                    : sighting.corners_px;
    tag.sides = with_lasting_error(side_sigmas(sighting, frame.pixel_noise, cells),
                                   sighting.corners_px, cells);
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

std::optional<TagCorners> corners_of_fitted_sides(const CameraModel& camera,
                                                  const TagCorners& ideal_px) {
  std::array<Line, 4> sides;
  for (std::size_t i = 0; i < 4; ++i) {
    std::array<Eigen::Vector2d, kPointsPerLine> points;
    const Eigen::Vector2d along = ideal_px[(i + 1) % 4] - ideal_px[i];
    const double end = skipped_end(along.norm());
    for (int k = 0; k < kPointsPerLine; ++k) {
      const double t = end + (1 - 2 * end) * (k + 0.5) / kPointsPerLine;
      const Eigen::Vector2d px = ideal_px[i] + t * along;
      const auto raw =
          camera.project({(px.x() - camera.cu) / camera.fu, (px.y() - camera.cv) / camera.fv, 1.0});
      if (!raw) return std::nullopt;
      points[static_cast<std::size_t>(k)] = *raw;
    }
    sides[i] = fit_line(points);
  }
  TagCorners corners;
  for (std::size_t i = 0; i < 4; ++i) corners[i] = intersection(sides[(i + 3) % 4], sides[i]);
  return corners;
}

TagCorners unbend_corners(const CameraModel& camera, const TagCorners& raw_px) {
  if (camera.distortion == Distortion::kNone) return raw_px;
  TagCorners corrected = raw_px;
  for (int round = 0; round < kRounds; ++round) {
    TagCorners ideal;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto pixel = undistort(camera, corrected[i]);
      if (!pixel) return raw_px;
      ideal[i] = pixel->px;
    }
    const auto fitted = corners_of_fitted_sides(camera, ideal);
    if (!fitted) return raw_px;
    for (std::size_t i = 0; i < 4; ++i) corrected[i] += raw_px[i] - (*fitted)[i];
  }
  return corrected;
}

}  // namespace fiducap
