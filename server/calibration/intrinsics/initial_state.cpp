#include "calibration/intrinsics/initial_state.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "detection/planar_target.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kSightings = 120;
constexpr std::size_t kMaxStarts = 3;
constexpr double kFocalStep = 1.15;  // the adjustment converges from further away
constexpr double kLostPoint_px = 30;
// Angle of half of the image width at the shortest and the longest focal length.
constexpr double kWidest_rad = 75 * std::numbers::pi / 180;
constexpr double kWidestFisheye_rad = 100 * std::numbers::pi / 180;
constexpr double kNarrowest_rad = 4 * std::numbers::pi / 180;

std::vector<TargetPose> poses_of_tag(const CalibrationTarget& target,
                                     const TargetSighting& sighting, const CameraModel& camera) {
  TagObservation tag;
  tag.edge_m = (target.points[1] - target.points[0]).norm();
  for (std::size_t i = 0; i < 4; ++i) {
    const auto ideal = undistort(camera, sighting.points[i].px);
    if (!ideal) return {};
    tag.corners_px[i] = ideal->px;
    tag.ideal_from_raw[i] = ideal->ideal_from_raw;
  }
  std::vector<TargetPose> poses;
  for (const TagPose& pose : solve_tag_pose(tag, camera))
    if (std::isfinite(pose.rms_px)) poses.push_back({pose.X_VT, pose.rms_px});
  return poses;
}

std::vector<TargetPose> poses_of_board(const CalibrationTarget& target,
                                       const TargetSighting& sighting, const CameraModel& camera) {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> px;
  for (const SeenPoint& seen : sighting.points) {
    points.push_back(target.points[to_index(seen.point)]);
    px.push_back(seen.px);
  }
  std::vector<TargetPose> poses;
  for (const Pose& X_VT : solve_plane_pose(points, px, camera))
    poses.push_back({X_VT, reprojection_rms_px(target, sighting, camera, X_VT, camera.width)});
  return poses;
}

/// Sightings spread evenly over the recording.
std::vector<const TargetSighting*> sample_sightings(const CalibrationData& data) {
  std::vector<const TargetSighting*> all;
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& sighting : view.sightings) all.push_back(&sighting);
  return thinned(all, kSightings);
}

CameraModel bare_camera(const CalibrationData& data, Distortion kind, double focal_px) {
  CameraModel camera;
  camera.width = data.width;
  camera.height = data.height;
  camera.fu = camera.fv = focal_px;
  camera.cu = (data.width - 1) / 2.0;
  camera.cv = (data.height - 1) / 2.0;
  camera.distortion = kind;
  return camera;
}

double score(const CalibrationData& data, const std::vector<const TargetSighting*>& sightings,
             const CameraModel& camera) {
  std::vector<double> rms;
  for (const TargetSighting* sighting : sightings) {
    const auto poses = poses_of(data.target_of(*sighting), *sighting, camera);
    rms.push_back(poses.empty() ? kLostPoint_px : std::min(poses.front().rms_px, kLostPoint_px));
  }
  double sum = 0;  // of the better nine tenths, without outliers
  std::ranges::sort(rms);
  const std::size_t count = std::max<std::size_t>(1, rms.size() * 9 / 10);
  for (std::size_t i = 0; i < count; ++i) sum += rms[i];
  return sum / static_cast<double>(count);
}

}  // namespace

std::vector<TargetPose> poses_of(const CalibrationTarget& target, const TargetSighting& sighting,
                                 const CameraModel& camera) {
  const bool one_tag = target.points.size() == 4;
  auto poses =
      one_tag ? poses_of_tag(target, sighting, camera) : poses_of_board(target, sighting, camera);
  std::ranges::sort(poses, {}, &TargetPose::rms_px);
  return poses;
}

double reprojection_rms_px(const CalibrationTarget& target, const TargetSighting& sighting,
                           const CameraModel& camera, const Pose& X_VT, double lost_px) {
  double sum = 0;
  for (const SeenPoint& seen : sighting.points) {
    const auto px = camera.project(X_VT * target.points[to_index(seen.point)]);
    sum += px ? std::min((*px - seen.px).squaredNorm(), lost_px * lost_px) : lost_px * lost_px;
  }
  return std::sqrt(sum / static_cast<double>(sighting.points.size()));
}

std::vector<FocalStart> search_focal_length(const CalibrationData& data, Distortion kind) {
  const auto sightings = sample_sightings(data);
  if (sightings.empty()) return {};
  const bool fisheye = kind == Distortion::kEquidistant;
  const double half = data.width / 2.0;
  const double shortest = fisheye ? half / kWidestFisheye_rad : half / std::tan(kWidest_rad);
  const double longest = half / std::tan(kNarrowest_rad);
  std::vector<FocalStart> tried;
  for (double f = shortest; f < longest; f *= kFocalStep) {
    const CameraModel camera = bare_camera(data, kind, f);
    tried.push_back({camera, score(data, sightings, camera)});
  }
  std::vector<FocalStart> starts;
  for (std::size_t i = 0; i < tried.size(); ++i) {
    const bool left = i == 0 || tried[i].rms_px <= tried[i - 1].rms_px;
    const bool right = i + 1 == tried.size() || tried[i].rms_px <= tried[i + 1].rms_px;
    if (left && right && tried[i].rms_px < kLostPoint_px) starts.push_back(tried[i]);
  }
  std::ranges::sort(starts, {}, &FocalStart::rms_px);
  if (starts.size() > kMaxStarts) starts.resize(kMaxStarts);
  return starts;
}

}  // namespace fiducap
