#include "pipeline/point_follower.hpp"

namespace fiducap {

std::span<const PointSighting> PointFollower::follow(const CameraFrame& frame,
                                                     const CameraModel& model,
                                                     const std::optional<Eigen::Quaterniond>& q_WV,
                                                     std::span<const TagSighting> tags) {
  Eye& eye = eyes_[static_cast<std::size_t>(frame.camera)];
  std::optional<Eigen::Quaterniond> q_beforeNow;
  if (q_WV && eye.q_WV) q_beforeNow = eye.q_WV->conjugate() * *q_WV;
  eye.q_WV = q_WV;
  return eye.tracker.follow(frame, model, q_beforeNow, tags);
}

void PointFollower::corrected(int camera, const std::optional<Eigen::Quaterniond>& q_WV) {
  eyes_[static_cast<std::size_t>(camera)].q_WV = q_WV;
}

PointStatistics PointFollower::statistics() const {
  PointStatistics all;
  for (const Eye& eye : eyes_) {
    const PointStatistics& one = eye.tracker.statistics();
    all.images += one.images;
    all.followed += one.followed;
    all.lost += one.lost;
    all.not_back += one.not_back;
    all.on_tags += one.on_tags;
    all.moving += one.moving;
    all.begun += one.begun;
  }
  return all;
}

}  // namespace fiducap
