#include "simulation/corner_camera.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "simulation/random.hpp"
#include "simulation/room_shape.hpp"

namespace fiducap::simulation {

namespace {

using Corners = std::array<Eigen::Vector2d, 4>;

constexpr int kRowSteps =
    3;  // each brings the row closer by the share of an image that the point moves while it is read

bool inside(const CameraModel& model, const Eigen::Vector2d& px) {
  return px.x() >= 0 && px.y() >= 0 && px.x() <= model.width - 1 && px.y() <= model.height - 1;
}

/// A rolling shutter exposes a point in the row in which it appears: where that is, is found by
/// going there.
std::optional<Eigen::Vector2d> project(const CameraModel& model, const CameraPath& path,
                                       const Pose& X_VW, const Eigen::Vector3d& p_W) {
  auto px = model.project(X_VW * p_W);
  for (int i = 0; i < kRowSteps && px; ++i) {
    px = model.project(path(px->y() / (model.height - 1) - 0.5).inverse() * p_W);
  }
  return px;
}

/// The true corners, if the rules allow this tag to be seen from here.
std::optional<Corners> visible_corners(const CameraModel& model, const CameraPath& path,
                                       const Pose& X_WV, const RecordedTag& tag,
                                       const CameraSimulation& rules) {
  const Pose X_VW = X_WV.inverse();
  const Eigen::Vector3d to_camera = X_WV.p - tag.X_WT.p;
  const double cos_tilt = (tag.X_WT.q * Eigen::Vector3d::UnitZ()).dot(to_camera) / to_camera.norm();
  if (!(cos_tilt >= std::cos(rules.max_tilt_rad)) || (X_VW * tag.X_WT.p).z() <= 0)
    return std::nullopt;
  Corners corners;
  const auto corners_W = corners_of(tag);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto px = project(model, path, X_VW, corners_W[i]);
    if (!px || !inside(model, *px)) return std::nullopt;
    corners[i] = *px;
  }
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if ((corners[(i + 1) % 4] - corners[i]).norm() < rules.min_side_px) return std::nullopt;
  }
  return corners;
}

void drop_doubles(std::vector<TagSighting>& sightings) {
  const auto less = [](const TagSighting& a, const TagSighting& b) { return a.tag_id < b.tag_id; };
  std::sort(sightings.begin(), sightings.end(), less);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < sightings.size();) {
    std::size_t next = i + 1;
    while (next < sightings.size() && sightings[next].tag_id == sightings[i].tag_id) ++next;
    if (next == i + 1) sightings[kept++] = sightings[i];
    i = next;
  }
  sightings.resize(kept);
}

}  // namespace

void sight_corners(const CameraModel& model, const CameraPath& path,
                   const std::vector<RecordedTag>& tags, const CameraSimulation& rules,
                   const ImageKey& key, std::vector<TagSighting>& out) {
  out.clear();
  const Pose X_WV = path(0);
  Random random(key.seed, Purpose::kCornerNoise, static_cast<std::uint64_t>(key.camera), key.k);
  for (const RecordedTag& tag : tags) {
    const auto corners = visible_corners(model, path, X_WV, tag, rules);
    if (!corners || random.chance(rules.miss_probability)) continue;
    TagSighting sighting;
    sighting.tag_id = tag.tag_id;
    for (std::size_t i = 0; i < corners->size(); ++i) {
      const double du = random.normal();
      const double dv = random.normal();
      sighting.corners_px[i] = (*corners)[i] + rules.corner_noise_px * Eigen::Vector2d(du, dv);
    }
    out.push_back(sighting);
  }
  drop_doubles(out);
}

}  // namespace fiducap::simulation
