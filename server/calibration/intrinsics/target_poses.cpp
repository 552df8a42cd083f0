#include "calibration/intrinsics/target_poses.hpp"

#include <algorithm>
#include <cmath>

#include "detection/plane_pose.hpp"
#include "detection/tag_pose.hpp"

namespace fiducap {
namespace {

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
    points.push_back(target.points[static_cast<std::size_t>(seen.point)]);
    px.push_back(seen.px);
  }
  std::vector<TargetPose> poses;
  for (const Pose& X_VT : solve_plane_pose(points, px, camera))
    poses.push_back({X_VT, reprojection_rms_px(target, sighting, camera, X_VT, camera.width)});
  return poses;
}

}  // namespace

std::vector<TargetPose> poses_of(const CalibrationTarget& target, const TargetSighting& sighting,
                                 const CameraModel& camera) {
  const bool one_tag = target.points.size() == 4;
  auto poses =
      one_tag ? poses_of_tag(target, sighting, camera) : poses_of_board(target, sighting, camera);
  std::sort(poses.begin(), poses.end(),
            [](const auto& a, const auto& b) { return a.rms_px < b.rms_px; });
  return poses;
}

double reprojection_rms_px(const CalibrationTarget& target, const TargetSighting& sighting,
                           const CameraModel& camera, const Pose& X_VT, double lost_px) {
  double sum = 0;
  for (const SeenPoint& seen : sighting.points) {
    const auto px = camera.project(X_VT * target.points[static_cast<std::size_t>(seen.point)]);
    sum += px ? std::min((*px - seen.px).squaredNorm(), lost_px * lost_px) : lost_px * lost_px;
  }
  return std::sqrt(sum / static_cast<double>(sighting.points.size()));
}

}  // namespace fiducap
